// A controller of height, roll and pitch, as a program of its own.

#include <hummingbus/hummingbus.hpp>
#include <hummingbus/messages.hpp>

#include <array>

using namespace hummingbus::msgs;

// Roll and pitch (positive nose down) of an attitude near level, rad.
static std::array<double, 2> tilt_rad(const Quaternion& q) {
  return {2 * (q.w * q.x + q.y * q.z), 2 * (q.w * q.y - q.z * q.x)};
}

static double law(const std::array<double, 2>& gains, double error, double rate) {
  return gains[0] * error - gains[1] * rate;
}

int main() {
  return hummingbus::program([] {
    hummingbus::Node node;
    const auto set_point = node.input<SetPoint>("set_point");
    const auto estimate = node.input<StateEstimate>("estimate");
    const auto command = node.output<MotorCommand>("command");
    // The table `parameters` of the manifest, with defaults that are tuned for the vehicle file of this project:
    // the command at which the vehicle hovers, in counts; counts per metre of height error and per metre a second of
    // climb; counts per radian of roll or pitch error and per radian a second of rate; counts per radian a second of yaw
    // rate.
    const double hover = node.number("hover", 76.5);
    const auto altitude = node.numbers<2>("altitude", {63.6, 31.8}), tilt = node.numbers<2>("tilt", {11.6, 4.4});
    const double yaw_rate = node.number("yaw_rate", 5.0);

    node.run([&](hummingbus::Tick& tick) {
      const SetPoint& wanted = tick.get(set_point);
      const StateEstimate& found = tick.get(estimate);
      const double lift = hover + law(altitude, wanted.altitude - found.position.z, found.velocity.z);
      const auto [roll_rad, pitch_rad] = tilt_rad(found.attitude);
      const double roll = law(tilt, wanted.roll - roll_rad, found.angular_velocity.x);
      const double pitch = law(tilt, wanted.pitch - pitch_rad, found.angular_velocity.y);
      const double yaw = -yaw_rate * found.angular_velocity.z;
      // Rotors in the order of the vehicle file: front, right, rear, left. A positive roll lifts the left side, a
      // positive pitch the rear. The drag of the clockwise rotors, front and rear, yaws to the left.
      MotorCommand sent;
      for (const double part : {yaw - pitch, -yaw - roll, yaw + pitch, -yaw + roll}) sent.command.push_back(lift + part);
      tick.write(command, sent);
    });
  });
}
