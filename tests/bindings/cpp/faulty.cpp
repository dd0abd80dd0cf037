// A pilot that does what its parameter `fault` says.

#include <hummingbus/hummingbus.hpp>
#include <hummingbus/messages.hpp>

#include <limits>
#include <string>

using namespace hummingbus::msgs;

struct Cells {
  Time stamp{};
  double voltage{};
  hummingbus::Bounded<double, 4> cells{};
};
HUMMINGBUS_MESSAGE(Cells, "test_msgs/msg/Cells", "Voltages of a battery.",
                   HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
                   HUMMINGBUS_FIELD(voltage, "V", "", "Voltage at the terminals."),
                   HUMMINGBUS_FIELD(cells, "V", "", "Voltages of the cells."));

// SetPoint as it was before a field was added.
struct OldSetPoint {
  Time stamp{};
  double altitude{};
};
HUMMINGBUS_MESSAGE(OldSetPoint, "hummingbus_msgs/msg/SetPoint", "An older set point.",
                   HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
                   HUMMINGBUS_FIELD(altitude, "m", "world", "Altitude."));

struct Padded {
  std::uint32_t flag{};
  double voltage{};
};
HUMMINGBUS_MESSAGE(Padded, "test_msgs/msg/Cells", "A message with padding.", HUMMINGBUS_FIELD(flag, "1", "", "A flag."),
                   HUMMINGBUS_FIELD(voltage, "V", "", "Voltage at the terminals."));

#pragma pack(push, 4)
struct Unaligned {
  std::uint32_t flag{};
  double voltage{};
};
#pragma pack(pop)
HUMMINGBUS_MESSAGE(Unaligned, "test_msgs/msg/Cells", "A message that CDR lays out otherwise.",
                   HUMMINGBUS_FIELD(flag, "1", "", "A flag."),
                   HUMMINGBUS_FIELD(voltage, "V", "", "Voltage at the terminals."));

// Declares a message whose table is wrong, as one by hand may be.
void declare_wrong_kind() {
  HbNode* node = nullptr;
  hummingbus::detail::require(hb_node_join(&node));
  const HbField field = {"voltage", "", "V", "", 0, 77, nullptr, 0, 0, 0};
  const HbMessage message = {"test_msgs/msg/Cells", "", 8, &field, 1};
  std::uint32_t number = 0;
  hummingbus::detail::require(hb_node_output(node, "battery", &message, &number));
}

int main() {
  return hummingbus::program([] {
    hummingbus::Node node;
    const std::string fault = node.text("fault");
    if (fault == "missing") node.numbers<2>("gains.altitude");
    if (fault == "array") node.numbers<3>("fault");
    if (fault == "port") node.output<SetPoint>("nothing");
    if (fault == "type") node.output<MotorCommand>("set_point");
    if (fault == "padding") node.output<Padded>("battery");
    if (fault == "unaligned") node.output<Unaligned>("battery");
    if (fault == "kind") declare_wrong_kind();
    if (fault == "twice") node.state<SetPoint>(), node.state<SetPoint>();
    const auto battery = node.output<Cells>("battery");
    if (fault == "layout") {
      const auto set_point = node.output<OldSetPoint>("set_point");
      node.run([&](hummingbus::Tick& tick) { tick.write(set_point, OldSetPoint{}); });
      return;
    }
    const auto set_point = node.output<SetPoint>("set_point");
    node.run([&](hummingbus::Tick& tick) {
      const bool is_time = tick.number() == 100;
      SetPoint asked;
      asked.altitude = 1.0;
      if (is_time && fault == "throw") throw std::runtime_error("the battery is empty");
      if (is_time && fault == "throw-other") throw 7;
      if (is_time && fault == "nan") asked.altitude = std::numeric_limits<double>::quiet_NaN();
      if (is_time && fault == "handle") tick.get(hummingbus::Input<SetPoint>{7});
      if (!is_time || fault != "unwritten") tick.write(set_point, asked);
      // The same memory once more: it holds what was written.
      if (fault == "none" && tick.output(set_point)->altitude != 1.0) throw std::runtime_error("the set point is gone");
      Cells cells;
      cells.voltage = 11.5;
      cells.cells = {3.8, 3.8, 3.9};
      tick.write(battery, cells);
    });
  });
}
