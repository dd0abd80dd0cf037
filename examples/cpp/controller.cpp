// The law of the controller `pid` in C++, for a quadrotor with its arms along the axes of the body. It takes over from `pid`
// in flight, and `pid` from it: both have the same state.

#include <hummingbus/hummingbus.hpp>
#include <hummingbus/messages.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace hummingbus::msgs;

int main() {
  return hummingbus::program([] {
    hummingbus::Node node;
    const auto set_point = node.input<SetPoint>("set_point");
    const auto estimate = node.input<StateEstimate>("estimate");
    const auto command = node.output<MotorCommand>("command");
    auto& state = node.state<ControllerState>();
    const double mass = node.number("mass_kg"), arm = node.number("arm_m"), period = node.period_s();
    const auto inertia = node.numbers<3>("inertia_kg_m2");
    // N and N*m for each rpm^2; counts for each rpm, and at 0 rpm.
    const auto rotor = node.numbers<2>("rotor"), counts = node.numbers<2>("counts");
    // Proportional, integral and derivative gain: 1/s^2, 1/s^3, 1/s.
    const auto altitude = node.numbers<3>("altitude"), tilt = node.numbers<3>("tilt"), yaw = node.numbers<3>("yaw");

    node.run([&](hummingbus::Tick& tick) {
      const SetPoint& asked = tick.get(set_point);
      const StateEstimate& found = tick.get(estimate);
      const auto& [x, y, z, w] = found.attitude;
      const double roll = std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y));
      const double pitch = std::asin(2 * (w * y - z * x));
      const double turn = std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));

      const double low = asked.altitude - found.position.z, climb = found.velocity.z;
      double& lift = state.integrals.lift;
      if (std::abs(climb) <= 0.1) lift = std::clamp(lift + altitude[1] * low * period, -2.0, 2.0);
      const double up = altitude[0] * low + lift - altitude[2] * climb;
      state.thrust = mass * (9.81 + up) / std::max(std::cos(roll) * std::cos(pitch), 0.5);
      const auto angle = [](const auto& gain, double error, double rate) { return gain[0] * error - gain[2] * rate; };
      const auto& rate = found.angular_velocity;
      state.torque = {inertia[0] * angle(tilt, asked.roll - roll, rate.x), inertia[1] * angle(tilt, asked.pitch - pitch, rate.y),
                      inertia[2] * angle(yaw, std::remainder(asked.yaw - turn, 2 * M_PI), rate.z)};
      std::strcpy(reinterpret_cast<char*>(state.id.name.data()), "cpp");

      // Front, right, rear, left: the first and the third turn clockwise.
      const auto [about_x, about_y, about_z] = state.torque;
      const double even = state.thrust / (4 * rotor[0]), side = 1 / (2 * arm * rotor[0]), spin = about_z / (4 * rotor[1]);
      MotorCommand sent;
      for (const double square : {even - side * about_y + spin, even - side * about_x - spin, even + side * about_y + spin,
                                  even + side * about_x - spin})
        sent.command.push_back(std::clamp(counts[0] * std::sqrt(std::max(square, 0.0)) + counts[1], 1.0, 200.0));
      tick.write(command, sent);
    });
  });
}
