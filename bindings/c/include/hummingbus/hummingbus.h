// The C interface of hummingbus. Made by cbindgen from bindings/c/src: not to be edited.

#ifndef HUMMINGBUS_H
#define HUMMINGBUS_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Success.
#define HB_OK 0

// Failure; `hb_last_error` returns the reason.
#define HB_FAILED 1

// The launcher aborted the run. The program exits without a message.
#define HB_ABORTED 2

// Type of a value.
typedef enum HbKind {
  // `double`.
  HB_F64 = 0,
  // `float`.
  HB_F32 = 1,
  // `int64_t`.
  HB_I64 = 2,
  // `uint64_t`.
  HB_U64 = 3,
  // `int32_t`.
  HB_I32 = 4,
  // `uint32_t`.
  HB_U32 = 5,
  // `int16_t`.
  HB_I16 = 6,
  // `uint16_t`.
  HB_U16 = 7,
  // `int8_t`.
  HB_I8 = 8,
  // `uint8_t`.
  HB_U8 = 9,
  // Another message.
  HB_NESTED = 10,
} HbKind;

// A node of a run, before its first tick.
typedef struct HbNode HbNode;

// One step of a node, valid until the step returns.
typedef struct HbTick HbTick;

// A field of a message. Texts are UTF-8; where there is none, null or empty.
typedef struct HbField {
  // Name, as ROS 2 allows it: small letters, digits, single underscores.
  const char *name;
  // Meaning, in one line.
  const char *doc;
  // Unit of its numbers, `1` where they have none, empty where the enclosing field states it.
  const char *unit;
  // Frame in which it is expressed, empty where it has none.
  const char *frame;
  // Bytes from the start of the message.
  size_t offset;
  // Type of the value, or of each value of an array or a sequence: an `HbKind`.
  uint32_t kind;
  // Message of a `HbNested`; null otherwise.
  const struct HbMessage *message;
  // Values of a fixed array, or its arrays; 0 for a single value.
  size_t array;
  // Values of each array of an array of arrays; 0 otherwise.
  size_t inner_array;
  // The most values of a sequence: `uint32_t` count, `uint32_t` zero, then room for so many; 0 where it is none.
  size_t sequence;
} HbField;

// A message: its name, its size and its fields in memory order, without padding. Both ends of a topic have to agree on
// all of it but the documentation.
typedef struct HbMessage {
  // ROS 2 name of three parts, such as `my_msgs/msg/Battery`.
  const char *type_name;
  // Meaning, in one line.
  const char *doc;
  // Size in bytes.
  size_t size;
  // The fields.
  const struct HbField *fields;
  // Their number.
  size_t field_count;
} HbMessage;

// A step: computes one tick of the node, with `user` as `hb_node_run` was given it. Returns `HB_OK`, or what
// `hb_tick_fail` returns, and lets no exception out.
typedef int32_t (*HbStep)(void *user, struct HbTick *tick);

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Reason of the last call on this thread that failed: UTF-8, valid until the next call that fails. Empty if none has.
const char *hb_last_error(void);

// Hash of the layout of a message, which both ends of a topic have to agree on; 0 if it is refused, and `hb_last_error` says
// why.
//
// # Safety
// `message` is a description.
uint64_t hb_message_layout_hash(const struct HbMessage *message);

// Joins the run that started this process. `*node` is freed with `hb_node_free`.
//
// # Safety
// `node` points to a pointer.
int32_t hb_node_join(struct HbNode **node);

// Frees a node; does nothing if `node` is null.
//
// # Safety
// `node` is null or came from `hb_node_join` and was not freed.
void hb_node_free(struct HbNode *node);

// The node's name in the run, as long as the node lives.
//
// # Safety
// `node` came from `hb_node_join` and was not freed.
const char *hb_node_name(const struct HbNode *node);

// Simulated time between two steps of the node, in seconds; NaN once it runs.
//
// # Safety
// As `hb_node_name`.
double hb_node_period_s(const struct HbNode *node);

// The seed of the run; 0 once the node runs.
//
// # Safety
// As `hb_node_name`.
uint64_t hb_node_seed(const struct HbNode *node);

// True if the manifest wires an input `port`, or names an output of this name.
//
// # Safety
// `node` as for `hb_node_name`; `port` is a text.
bool hb_node_is_wired(const struct HbNode *node, const char *port);

// Declares the input `port`, whose messages are `message`. `*input` is its number for `hb_tick_input`.
//
// # Safety
// `node` as for `hb_node_name`; `port` is a text, `message` a description, `input` points to a number.
int32_t hb_node_input(struct HbNode *node, const char *port, const struct HbMessage *message, uint32_t *input);

// Declares the output `port`, whose messages are `message`. `*output` is its number for `hb_tick_output`.
//
// # Safety
// As `hb_node_input`.
int32_t hb_node_output(struct HbNode *node, const char *port, const struct HbMessage *message, uint32_t *output);

// Declares the state as one value of `message`. `*state` becomes its memory: zeros, aligned to eight bytes, as long as the
// process lives. All that changes from tick to tick belongs there, since whoever takes the node's place goes on
// from it, and since checkpoints hold it. The bus reads and writes it between steps.
//
// # Safety
// As `hb_node_input`.
int32_t hb_node_state(struct HbNode *node,
                      const struct HbMessage *message,
                      void **state);

// Connects, then calls `step` at every due tick, until the run ends or another process has taken the node's place. A
// parameter of the manifest that nothing has read is refused.
//
// # Safety
// `node` as for `hb_node_name`; `step` may be called with `user` as long as this runs.
int32_t hb_node_run(struct HbNode *node, HbStep step, void *user);

// True if the manifest gives the parameter `key`, such as `gains.altitude`.
//
// # Safety
// `node` came from `hb_node_join` and was not freed; `key` is a text.
bool hb_node_has_parameter(struct HbNode *node, const char *key);

// Copies the `count` numbers of the parameter `key`, a number or an array of numbers, to `values`.
//
// # Safety
// As `hb_node_has_parameter`; `values` has room for `count` numbers.
int32_t hb_node_numbers(struct HbNode *node, const char *key, double *values, size_t count);

// Sets `*value` to the text of the parameter `key`, valid as long as the node lives.
//
// # Safety
// As `hb_node_has_parameter`; `value` is a place.
int32_t hb_node_text(struct HbNode *node, const char *key, const char **value);

// Sets `*json` to all parameters as JSON, valid as long as the node lives. All of them count as read.
//
// # Safety
// As `hb_node_text`.
int32_t hb_node_parameters_json(struct HbNode *node, const char **json);

// Sets `*contents` to the text of the file that the parameter `key` names, with the bytes that it had when the run began:
// a file that the manifest names for the node. It is valid as long as the node lives.
//
// # Safety
// As `hb_node_text`.
int32_t hb_node_file(struct HbNode *node,
                     const char *key,
                     const char **contents);

// The tick's number.
//
// # Safety
// `tick` is what the step was given.
uint32_t hb_tick_number(struct HbTick *tick);

// Simulation time in nanoseconds.
//
// # Safety
// As `hb_tick_number`.
uint64_t hb_tick_time_ns(struct HbTick *tick);

// The newest message of input `input` that this tick may see: memory of its sender, shared, not to be written, aligned to
// eight bytes, valid until the step returns. Null if `hb_node_input` has given no such number; the step has failed then.
//
// # Safety
// As `hb_tick_number`.
const void *hb_tick_input(struct HbTick *tick,
                          uint32_t input);

// Memory of the message of output `output`: shared, zeros until the step writes them, aligned to eight bytes, valid until the
// step returns. Null if the step sends none, and if `hb_node_output` has given no such number; the step has failed then. The
// bus fills in the stamp, and sends the message when the step has returned.
//
// # Safety
// As `hb_tick_number`.
void *hb_tick_output(struct HbTick *tick,
                     uint32_t output);

// The last message on output `output` of the process whose place this one takes: to go on from without a jump.
// Given at the tick of the take-over, and only if no state was handed over. Null at every other tick.
//
// # Safety
// As `hb_tick_number`.
const void *hb_tick_predecessor(struct HbTick *tick, uint32_t output);

// Ends the run with `reason` when the step returns. Returns `HB_FAILED`, so that a step can return it.
//
// # Safety
// As `hb_tick_number`; `reason` is a text.
int32_t hb_tick_fail(struct HbTick *tick, const char *reason);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HUMMINGBUS_H */
