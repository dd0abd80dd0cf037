/* A pilot in C: asks for one height. */

#include <hummingbus/hummingbus.h>
#include <hummingbus/messages.h>

#include <stdio.h>
#include <string.h>

typedef struct Pilot {
  uint32_t set_point;
  double altitude;
} Pilot;

static int32_t step(void *user, HbTick *tick) {
  const Pilot *pilot = user;
  HbSetPoint *asked = hb_tick_output(tick, pilot->set_point);
  if (asked != NULL) asked->altitude = pilot->altitude;
  return HB_OK;
}

int main(void) {
  HbNode *node = NULL;
  Pilot pilot = {0};
  const char *name = "";
  int32_t status = hb_node_join(&node);
  if (status == HB_OK) status = hb_node_output(node, "set_point", &HB_SET_POINT, &pilot.set_point);
  if (status == HB_OK) status = hb_node_numbers(node, "altitude_m", &pilot.altitude, 1);
  if (status == HB_OK) status = hb_node_text(node, "name", &name);
  if (status == HB_OK && strcmp(name, "up") != 0) return 2;
  if (status == HB_OK) status = hb_node_run(node, step, &pilot);
  if (status == HB_ABORTED) status = HB_OK; /* The launcher knows why. */
  if (status != HB_OK) fprintf(stderr, "error: %s\n", hb_last_error());
  hb_node_free(node);
  return status;
}
