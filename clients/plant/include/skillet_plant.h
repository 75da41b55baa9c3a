/* A robot or a simulator of your own behind a Skillet controller: the plant's end, for C and C++.
 * Link with -lskillet_plant. No function waits without a limit. SI units; arrays of joints have 7
 * places, of which the first n_joints count. */
#ifndef SKILLET_PLANT_H
#define SKILLET_PLANT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SKILLET_JOINTS 7

/* What the controller wants; SKILLET_ERROR: skillet_plant_error() says why. */
enum {
  SKILLET_ERROR = -1,
  SKILLET_TORQUE = 0, /* apply tau */
  SKILLET_RESET = 1,  /* begin another episode, then call skillet_plant_has_reset(); tau holds a real arm */
  SKILLET_HOLD = 2,   /* there is no torque: a real arm holds itself, damped */
  SKILLET_STOP = 3    /* the controller ends cleanly */
};

typedef struct {
  const char *name;
  const char *cell;    /* NULL: "skillet"; the variable SKILLET_PLANT goes before it */
  int n_joints;
  int simulated;       /* 1: in lockstep, skillet_plant_exchange(); 0: send and answer, by your own clock */
  int has_object;      /* samples say where the tracked object is */
  int deterministic;
  int polls;           /* 1: a simulator with a core of its own polls shared memory for its answers */
  double period_s;
  const char *joint_names[SKILLET_JOINTS]; /* NULL: not compared with the controller's */
  double torque_limits[SKILLET_JOINTS];    /* N m; 0: not compared */
  double q[SKILLET_JOINTS];                /* where the arm rests, rad */
} skillet_description;

typedef struct {
  uint64_t t_ns;       /* your time, growing; 0: one period has passed */
  double q[SKILLET_JOINTS], qd[SKILLET_JOINTS], tau[SKILLET_JOINTS]; /* rad, rad/s, N m */
  int has_object, in_contact;
  double object_position[3], object_quaternion[4]; /* in the world, m; w, x, y, z */
} skillet_sample;

typedef struct skillet_plant skillet_plant;

/* Waits up to 30 s for the controller. NULL: `error` says why. */
skillet_plant *skillet_plant_open(const skillet_description *description, char *error, size_t error_len);

/* A simulator's: sends a sample, waits for its answer. */
int skillet_plant_exchange(skillet_plant *plant, const skillet_sample *sample, double tau[SKILLET_JOINTS]);

/* A robot's: sends a sample and does not wait; then asks what to do, for at most patience_us. Without an
 * answer the last torque acts for two samples, then it is SKILLET_HOLD. */
int skillet_plant_send(skillet_plant *plant, const skillet_sample *sample);
int skillet_plant_answer(skillet_plant *plant, uint32_t patience_us, double tau[SKILLET_JOINTS]);

/* The next sample is the first of the episode that was asked for. */
void skillet_plant_has_reset(skillet_plant *plant);

/* Number in the session of the rollout that was asked for: a world that varies draws by it. */
uint64_t skillet_plant_rollout(const skillet_plant *plant);

const char *skillet_plant_error(const skillet_plant *plant);
void skillet_plant_close(skillet_plant *plant);

#ifdef __cplusplus
}
#endif
#endif
