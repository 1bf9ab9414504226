// Times every one of many frames through the C interface, and counts allocations.
//
//     cargo build --release --package tanker_pose_c
//     cc -O2 -Icrates/tanker_pose_c/include -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=posix_memalign \
//       benches/c/slowest.c target/release/libtanker_pose_c.a -lm -lpthread -ldl -o slowest && ./slowest 10000000
//
// Six points a frame, the paper's markers and camera, attitudes within 5 degrees of the nominal one, 0.5 px of noise; each
// frame is another. All frames are timed three times. The least time of a frame is its own; the greatest of one pass also
// has what the machine did meanwhile.
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "tanker_pose.h"

#define POINTS 6
#define PASSES 3

static const tanker_pose_Marker markers[POINTS] = {
    {1, 3.7, -7.13, 0.7},  {2, 3.7, 7.13, 0.7},  {3, 7.79, -2.689, 0.7},
    {4, 7.79, 2.689, 0.7}, {5, 7.96, 0.0, 3.189}, {6, 0.0, 0.0, 0.0},
};

static uint64_t allocations;
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *at, size_t size);
int __real_posix_memalign(void **made, size_t alignment, size_t size);
void *__wrap_malloc(size_t size) { return allocations++, __real_malloc(size); }
void *__wrap_calloc(size_t count, size_t size) { return allocations++, __real_calloc(count, size); }
void *__wrap_realloc(void *at, size_t size) { return allocations++, __real_realloc(at, size); }
int __wrap_posix_memalign(void **made, size_t alignment, size_t size) {
  return allocations++, __real_posix_memalign(made, alignment, size);
}

static double uniform(uint64_t *state) {  // -1 to 1; SplitMix64
  uint64_t z = (*state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return (double)((z ^ (z >> 31)) >> 11) / 4503599627370496.0 - 1.0;
}

static double normal(uint64_t *state) {
  const double radius = sqrt(-2.0 * log((uniform(state) + 1.0) / 2.0 + 1e-17));
  return radius * cos(M_PI * uniform(state));
}

static void see(uint64_t index, tanker_pose_Detection *seen) {
  uint64_t state = index * 0xd1342543de82ef95u + 1;
  const double roll = 0.09 * uniform(&state), pitch = 0.09 * uniform(&state), yaw = 0.09 * uniform(&state);
  const double at[3] = {15.0 + 0.5 * uniform(&state), 0.5 * uniform(&state), 4.5 + 0.5 * uniform(&state)};
  const double r = cos(roll), rs = sin(roll), p = cos(pitch), ps = sin(pitch), y = cos(yaw), ys = sin(yaw);
  for (int i = 0; i < POINTS; i++) {
    const tanker_pose_Marker *m = &markers[i];
    const double a = r * m->y - rs * m->z, b = rs * m->y + r * m->z;
    const double c = p * m->x + ps * b, up = at[2] - ps * m->x + p * b;
    const double ahead = at[0] + y * c - ys * a, left = at[1] + ys * c + y * a;
    seen[i] = (tanker_pose_Detection){
        m->id, 254.0 - 571.0 * left / ahead + 0.5 * normal(&state), 206.0 - 571.0 * up / ahead + 0.5 * normal(&state), 0.5};
  }
}

static int ascending(const void *a, const void *b) {
  const float x = *(const float *)a, y = *(const float *)b;
  return (x > y) - (x < y);
}

static double now_ns(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

int main(int count, char **words) {
  const size_t frames = count > 1 ? strtoull(words[1], NULL, 10) : 1000000;
  const tanker_pose_Camera camera = {.fx = 571.0, .fy = 571.0, .cx = 254.0, .cy = 206.0, .width = 508, .height = 412};
  const tanker_pose_Options options = tanker_pose_default_options();
  tanker_pose_Estimator *estimator = NULL;
  float *least_ns = malloc(frames * sizeof *least_ns);
  char why[256];
  if (frames == 0 || least_ns == NULL ||
      tanker_pose_create(&camera, markers, POINTS, &options, &estimator, why, sizeof why) != TANKER_POSE_STATUS_OK) {
    fprintf(stderr, "slowest: no frames, no memory or no estimator\n");
    return 1;
  }
  uint64_t outcomes[16] = {0}, made = 0;
  float slowest_ns = 0;
  for (int pass = 0; pass < PASSES; pass++) {
    float slowest_of_pass_ns = 0;
    for (size_t i = 0; i < frames; i++) {
      tanker_pose_Detection seen[POINTS];
      tanker_pose_Pose pose;
      see(i, seen);
      const uint64_t before = allocations;
      const double begin_ns = now_ns();
      const int status = tanker_pose_estimate(estimator, seen, POINTS, &pose);
      const float took_ns = (float)(now_ns() - begin_ns);
      made += allocations - before;
      if (status != TANKER_POSE_STATUS_OK || pose.outcome >= 16) return 1;
      outcomes[pose.outcome] += pass == 0;
      least_ns[i] = pass == 0 || took_ns < least_ns[i] ? took_ns : least_ns[i];
      if (took_ns > slowest_of_pass_ns) slowest_of_pass_ns = took_ns;
    }
    if (pass == 0 || slowest_of_pass_ns < slowest_ns) slowest_ns = slowest_of_pass_ns;
  }
  qsort(least_ns, frames, sizeof *least_ns, ascending);
  const double median_ns = least_ns[frames / 2];
  for (uint32_t i = 0; i < 16; i++) {
    if (outcomes[i] > 0) printf("%s: %llu\n", tanker_pose_outcome_name(i), (unsigned long long)outcomes[i]);
  }
  printf("allocations in %d passes: %llu\n", PASSES, (unsigned long long)made);
  printf("median %.0f ns; 99.9 %% of frames within %.1f medians, 99.9999 %% %.1f, all %.1f\n", median_ns,
         least_ns[(size_t)(0.999 * (double)frames)] / median_ns,
         least_ns[(size_t)(0.999999 * (double)frames)] / median_ns, least_ns[frames - 1] / median_ns);
  printf("slowest of one pass, interruptions included: %.1f medians\n", slowest_ns / median_ns);
  tanker_pose_destroy(estimator);
  free(least_ns);
  return 0;
}
