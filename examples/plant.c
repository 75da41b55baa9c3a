/* Seven joints of unit inertia without gravity: the smallest plant there is.
 *   cc examples/plant.c -Iclients/plant/include -Ltarget/release -lskillet_plant -o plant
 *   LD_LIBRARY_PATH=target/release ./plant kitchen [poll] */
#include <stdio.h>

#include "skillet_plant.h"

int main(int argc, char **argv) {
  char error[512];
  skillet_description about = {.name = "unit inertias", .cell = argc > 1 ? argv[1] : NULL,
                               .n_joints = 7, .simulated = 1, .has_object = 1,
                               .deterministic = 1, .polls = argc > 2,
                               .period_s = 0.001};
  skillet_plant *plant = skillet_plant_open(&about, error, sizeof error);
  if (!plant) return fprintf(stderr, "%s\n", error), 1;
  const skillet_sample start = {.has_object = 1, .object_quaternion = {1.0}};
  skillet_sample sample = start;
  for (;;) {
    double tau[SKILLET_JOINTS];
    switch (skillet_plant_exchange(plant, &sample, tau)) {
    case SKILLET_TORQUE:
      for (int i = 0; i < 7; i++) {
        sample.qd[i] += tau[i] * about.period_s;
        sample.q[i] += sample.qd[i] * about.period_s;
      }
      break;
    case SKILLET_RESET:
      sample = start;
      skillet_plant_has_reset(plant);
      break;
    case SKILLET_STOP: skillet_plant_close(plant); return 0;
    default: return fprintf(stderr, "%s\n", skillet_plant_error(plant)), 1;
    }
  }
}
