/* An FMU of FMI 3.0 in C: arrays and integers that are passed on, a counter as its state, and a crash on demand. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { POSITION = 1, SECONDS = 2, PASSED = 3, STEPS = 4, CRASH_AT = 5, NEGATIVE = 6, WEIGHT = 7, REACHED_US = 9 };

struct model {
  double position[3];
  int32_t seconds;
  uint64_t steps, crash_at;
  int64_t reached_us; /* Its time. */
};

typedef void log_message(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const uint32_t *required, size_t count, void *environment,
                                  log_message *log, void *update) {
  if (strcmp(token, "native") != 0 || resources != NULL) {
    log(environment, 3, "logStatusError", "the token is wrong, or there is a path of resources that the archive does not have");
    return NULL;
  }
  return calloc(1, sizeof(struct model));
}

void fmi3FreeInstance(void *model) { free(model); }

int fmi3EnterInitializationMode(void *model, bool tolerance, double value, double start, bool stop, double end) { return 0; }

int fmi3ExitInitializationMode(void *model) { return 0; }

int fmi3Terminate(void *model) { return 0; }

int fmi3DoStep(void *instance, double time, double step, bool final, bool *event, bool *ended, bool *early, double *reached) {
  struct model *model = instance;
  model->steps++;
  if (model->crash_at != 0 && model->steps >= model->crash_at) {
    *(volatile int *)NULL = 1;
  }
  *reached = time + step;
  model->reached_us = (int64_t)(1e6 * *reached + 0.5);
  return 0;
}

int fmi3SetFloat64(void *instance, const uint32_t *references, size_t count, const double *values, size_t length) {
  struct model *model = instance;
  if (count == 1 && references[0] == WEIGHT && length == 1) {
    return 0; /* Nothing depends on it. */
  }
  if (count != 1 || references[0] != POSITION || length != 3) {
    return 3;
  }
  memcpy(model->position, values, sizeof model->position);
  return 0;
}

int fmi3GetFloat64(void *instance, const uint32_t *references, size_t count, double *values, size_t length) {
  struct model *model = instance;
  if (count == 1 && references[0] == POSITION && length == 3) {
    memcpy(values, model->position, sizeof model->position);
    return 0;
  }
  if (count != 1 || references[0] != PASSED || length != 4) {
    return 3;
  }
  memcpy(values, model->position, sizeof model->position);
  values[3] = model->seconds;
  return 0;
}

int fmi3SetInt32(void *instance, const uint32_t *references, size_t count, const int32_t *values, size_t length) {
  ((struct model *)instance)->seconds = values[0];
  return 0;
}

int fmi3GetInt32(void *instance, const uint32_t *references, size_t count, int32_t *values, size_t length) {
  values[0] = ((struct model *)instance)->seconds;
  return 0;
}

int fmi3GetUInt64(void *instance, const uint32_t *references, size_t count, uint64_t *values, size_t length) {
  values[0] = ((struct model *)instance)->steps;
  return 0;
}

int fmi3SetUInt64(void *instance, const uint32_t *references, size_t count, const uint64_t *values, size_t length) {
  ((struct model *)instance)->crash_at = values[0];
  return 0;
}

int fmi3GetInt16(void *instance, const uint32_t *references, size_t count, int16_t *values, size_t length) {
  values[0] = -1;
  return 0;
}

int fmi3GetInt64(void *instance, const uint32_t *references, size_t count, int64_t *values, size_t length) {
  if (count != 1 || references[0] != REACHED_US) {
    return 3;
  }
  values[0] = ((struct model *)instance)->reached_us;
  return 0;
}

int fmi3GetFMUState(void *instance, void **state) {
  *state = malloc(sizeof(struct model));
  memcpy(*state, instance, sizeof(struct model));
  return 0;
}

int fmi3SetFMUState(void *instance, void *state) {
  memcpy(instance, state, sizeof(struct model));
  return 0;
}

int fmi3FreeFMUState(void *instance, void **state) {
  free(*state);
  *state = NULL;
  return 0;
}

int fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size) {
  *size = sizeof(struct model);
  return 0;
}

int fmi3SerializeFMUState(void *instance, void *state, uint8_t *bytes, size_t size) {
  memcpy(bytes, state, size);
  return 0;
}

int fmi3DeserializeFMUState(void *instance, const uint8_t *bytes, size_t size, void **state) {
  *state = malloc(sizeof(struct model));
  memcpy(*state, bytes, size);
  return 0;
}

/* Types that no variable has. */
#define REFUSED(name, type)                                                                                            \
  int name(void *model, const uint32_t *references, size_t count, type *values, size_t length) { return 3; }
REFUSED(fmi3GetFloat32, float)
REFUSED(fmi3SetFloat32, const float)
REFUSED(fmi3SetInt64, const int64_t)
REFUSED(fmi3SetInt16, const int16_t)
REFUSED(fmi3GetInt8, int8_t)
REFUSED(fmi3SetInt8, const int8_t)
REFUSED(fmi3GetUInt32, uint32_t)
REFUSED(fmi3SetUInt32, const uint32_t)
REFUSED(fmi3GetUInt16, uint16_t)
REFUSED(fmi3SetUInt16, const uint16_t)
REFUSED(fmi3GetUInt8, uint8_t)
REFUSED(fmi3SetUInt8, const uint8_t)
REFUSED(fmi3GetBoolean, bool)
REFUSED(fmi3SetBoolean, const bool)
REFUSED(fmi3SetString, const char *const)
