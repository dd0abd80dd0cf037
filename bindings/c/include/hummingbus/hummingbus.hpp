// The C++17 interface of hummingbus: nodes, over the C interface of hummingbus.h.
//
// Errors are exceptions of type hummingbus::Error. None crosses into the library: what a step throws ends the run with
// its text. Messages are plain structs; hummingbus/messages.hpp has those of the built-in components.

#pragma once

#include "hummingbus.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

namespace hummingbus {

// A failure, in words. `is_abort` is true if the launcher ended the run early, and knows the reason.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& text, bool is_abort = false) : std::runtime_error(text), is_abort_(is_abort) {}
  bool is_abort() const noexcept { return is_abort_; }

 private:
  bool is_abort_;
};

namespace detail {
// Throws unless `status` is HB_OK.
inline void require(std::int32_t status) {
  if (status != HB_OK) throw Error(hb_last_error(), status == HB_ABORTED);
}
} // namespace detail

// Up to N values: their count, and room for all. The last field of a message. Values behind the count are zero.
template <typename T, std::size_t N>
class Bounded {
 public:
  Bounded() = default;
  Bounded(std::initializer_list<T> values) {
    for (const T& value : values) push_back(value);
  }
  template <std::size_t M>
  Bounded(const std::array<T, M>& values) {
    static_assert(M <= N, "more values than there is room for");
    for (const T& value : values) push_back(value);
  }
  void push_back(const T& value) {
    if (count_ >= N) throw Error("a sequence of at most " + std::to_string(N) + " values is full");
    values_[count_++] = value;
  }
  std::size_t size() const noexcept { return count_; }
  T& operator[](std::size_t index) noexcept { return values_[index]; }
  const T& operator[](std::size_t index) const noexcept { return values_[index]; }
  T* begin() noexcept { return values_; }
  T* end() noexcept { return values_ + count_; }
  const T* begin() const noexcept { return values_; }
  const T* end() const noexcept { return values_ + count_; }

 private:
  std::uint32_t count_ = 0;
  std::uint32_t pad_ = 0;
  T values_[N] = {};
};

// Description of a message; HUMMINGBUS_MESSAGE makes one for a struct.
template <typename T>
struct Message;

namespace detail {
template <typename T>
HbField field(const char* name, std::size_t offset, const char* unit, const char* frame, const char* doc, T*) {
  HbField field = {name, doc, unit, frame, offset, HB_NESTED, nullptr, 0, 0, 0};
  if constexpr (std::is_arithmetic_v<T>) {
    static_assert(!std::is_same_v<T, bool> && !std::is_same_v<T, char> && !std::is_same_v<T, long double>,
                  "take a number of <cstdint>, a float or a double");
    constexpr bool is_float = std::is_floating_point_v<T>, is_signed = std::is_signed_v<T>;
    constexpr HbKind floats[] = {HB_F32, HB_F64};
    constexpr HbKind integers[2][4] = {{HB_U8, HB_U16, HB_U32, HB_U64}, {HB_I8, HB_I16, HB_I32, HB_I64}};
    constexpr std::size_t log2 = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
    field.kind = is_float ? floats[log2 - (is_float ? 2 : log2)] : integers[is_signed][log2];
  } else {
    field.message = &Message<T>::description();
  }
  return field;
}
template <typename T, std::size_t N>
HbField field(const char* name, std::size_t offset, const char* unit, const char* frame, const char* doc, std::array<T, N>*) {
  HbField inner = field(name, offset, unit, frame, doc, static_cast<T*>(nullptr));
  // An array of arrays has two lengths, and there are no more.
  inner.inner_array = inner.array;
  inner.array = N;
  return inner;
}
template <typename T, std::size_t N>
HbField field(const char* name, std::size_t offset, const char* unit, const char* frame, const char* doc, Bounded<T, N>*) {
  static_assert(alignof(T) == 8, "a sequence holds values of eight bytes");
  HbField inner = field(name, offset, unit, frame, doc, static_cast<T*>(nullptr));
  inner.sequence = N;
  return inner;
}
} // namespace detail

// An input whose messages are T.
template <typename T>
struct Input {
  std::uint32_t number;
};

// An output whose messages are T.
template <typename T>
struct Output {
  std::uint32_t number;
};

// One step of a node, valid until the step returns.
class Tick {
 public:
  explicit Tick(HbTick* tick) noexcept : tick_(tick) {}
  std::uint32_t number() const noexcept { return hb_tick_number(tick_); }
  // Simulation time.
  std::uint64_t time_ns() const noexcept { return hb_tick_time_ns(tick_); }
  double time_s() const noexcept { return static_cast<double>(time_ns()) * 1e-9; }

  // The newest message of an input that this tick may see, in shared memory.
  template <typename T>
  const T& get(Input<T> input) const {
    const void* message = hb_tick_input(tick_, input.number);
    if (message == nullptr) throw Error(hb_last_error());
    return *static_cast<const T*>(message);
  }

  // Memory of an output's message in shared memory, zeros; null where none is due. The bus fills in the stamp.
  template <typename T>
  T* output(Output<T> output) {
    return static_cast<T*>(hb_tick_output(tick_, output.number));
  }

  // Writes a message, where one is due. The bus fills in the stamp.
  template <typename T>
  void write(Output<T> output, const T& message) {
    if (T* memory = this->output(output)) *memory = message;
  }

  // The last message of the process whose place this one takes, if no state was handed over; null at every other tick.
  template <typename T>
  const T* predecessor(Output<T> output) const {
    return static_cast<const T*>(hb_tick_predecessor(tick_, output.number));
  }

 private:
  HbTick* tick_;
};

// A node of a run: it declares its ports and its state, and runs.
class Node {
 public:
  // Joins the run that started this process.
  Node() { detail::require(hb_node_join(&node_)); }
  ~Node() { hb_node_free(node_); }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  std::string name() const { return hb_node_name(node_); }
  // Simulated time between two steps, s.
  double period_s() const { return hb_node_period_s(node_); }
  std::uint64_t seed() const { return hb_node_seed(node_); }
  // True if the manifest wires an input of this name, or names an output.
  bool is_wired(const char* port) const { return hb_node_is_wired(node_, port); }

  template <typename T>
  Input<T> input(const char* port) {
    Input<T> input{};
    detail::require(hb_node_input(node_, port, &Message<T>::description(), &input.number));
    return input;
  }

  template <typename T>
  Output<T> output(const char* port) {
    Output<T> output{};
    detail::require(hb_node_output(node_, port, &Message<T>::description(), &output.number));
    return output;
  }

  // The state, zeros at first. All that changes from tick to tick belongs there: whoever takes the node's place goes on
  // from it, and checkpoints hold it. The bus reads and writes it between steps, until `run` returns.
  template <typename T>
  T& state() {
    void* memory = nullptr;
    detail::require(hb_node_state(node_, &Message<T>::description(), &memory));
    return *static_cast<T*>(memory);
  }

  // Parameters by their keys, such as "gains.altitude". One that is missing is an Error; one that is never read, too.
  bool has_parameter(const char* key) { return hb_node_has_parameter(node_, key); }
  double number(const char* key) { return numbers<1>(key)[0]; }
  double number(const char* key, double otherwise) { return has_parameter(key) ? number(key) : otherwise; }
  template <std::size_t N>
  std::array<double, N> numbers(const char* key) {
    std::array<double, N> values{};
    detail::require(hb_node_numbers(node_, key, values.data(), N));
    return values;
  }
  // The numbers, or `otherwise` if the manifest does not give the parameter.
  template <std::size_t N>
  std::array<double, N> numbers(const char* key, const std::array<double, N>& otherwise) {
    return has_parameter(key) ? numbers<N>(key) : otherwise;
  }
  std::string text(const char* key) { return texts(hb_node_text, key); }
  // Contents of the file that the parameter names, as it was when the run began.
  std::string file(const char* key) { return texts(hb_node_file, key); }

  // Calls `step` with a Tick& at every due tick until the run ends, or another process has taken the node's place.
  // The state stays where it is until the node is destroyed.
  template <typename Step>
  void run(Step&& step) {
    using Steps = std::decay_t<Step>;
    const HbStep trampoline = [](void* steps, HbTick* tick) -> std::int32_t {
      try {
        Tick view(tick);
        (*static_cast<Steps*>(steps))(view);
        return HB_OK;
      } catch (const std::exception& error) {
        return hb_tick_fail(tick, error.what());
      } catch (...) {
        return hb_tick_fail(tick, "it threw something that is no std::exception");
      }
    };
    Steps steps(std::forward<Step>(step));
    detail::require(hb_node_run(node_, trampoline, &steps));
  }

 private:
  std::string texts(std::int32_t (*read)(HbNode*, const char*, const char**), const char* key) {
    const char* value = nullptr;
    detail::require(read(node_, key, &value));
    return value;
  }

  HbNode* node_ = nullptr;
};

// The exit code of `body`, whose errors are printed: all of a `main`. A run that the launcher aborted ends without a message.
template <typename Body>
int program(Body&& body) noexcept {
  try {
    body();
    return 0;
  } catch (const Error& error) {
    if (error.is_abort()) return 0;
    std::fprintf(stderr, "error: %s\n", error.what());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
  } catch (...) {
    std::fputs("error: an exception that is no std::exception\n", stderr);
  }
  return 1;
}

} // namespace hummingbus

// Describes a struct as a message; stands outside of namespaces. Fields in memory order, without padding:
//   struct Battery { hummingbus::msgs::Time stamp{}; double voltage{}; };
//   HUMMINGBUS_MESSAGE(Battery, "my_msgs/msg/Battery", "Voltage of a battery.",
//                      HUMMINGBUS_FIELD(stamp, "", "", "Simulation time."),
//                      HUMMINGBUS_FIELD(voltage, "V", "", "Voltage at the terminals."));
#define HUMMINGBUS_MESSAGE(type, name, doc, ...)                                                              \
  template <>                                                                                                 \
  struct hummingbus::Message<type> {                                                                          \
    using Type = type;                                                                                        \
    static_assert(std::is_trivially_copyable_v<type> && std::is_standard_layout_v<type>,                      \
                  "a message is a plain struct");                                                             \
    static_assert(alignof(type) <= 8, "a message is aligned to at most eight bytes");                         \
    static const HbMessage& description() {                                                                   \
      static const HbField fields[] = {__VA_ARGS__};                                                          \
      static const HbMessage message = {name, doc, sizeof(type), fields, sizeof(fields) / sizeof(fields[0])}; \
      return message;                                                                                         \
    }                                                                                                         \
  }

// A field of HUMMINGBUS_MESSAGE: its name, the unit of its numbers (`1` where they have none), the frame it is expressed
// in, and its meaning.
#define HUMMINGBUS_FIELD(member, unit, frame, doc)                       \
  ::hummingbus::detail::field(#member, offsetof(Type, member), unit, frame, doc, \
                              static_cast<decltype(Type::member)*>(nullptr))
