// Solves frames of the paper's markers and camera from standard input, one line a frame:
//
//     echo '6  1 310.2 250.1 0.5  2 ...' | ./solve_frames
//
// each the number of detections, then id, column, row and standard deviation of each (px). Prints a line for each frame:
// the outcome's name, and for a trusted pose rotation, translation and covariance.
//
//     cargo build --release --package tanker_pose_c
//     cc -O2 -Icrates/tanker_pose_c/include examples/c/solve_frames.c target/release/libtanker_pose_c.a -lm -lpthread -ldl
#include <stdio.h>
#include <string.h>

#include "tanker_pose.h"

static const tanker_pose_Marker markers[] = {
    {1, 3.7, -7.13, 0.7},  {2, 3.7, 7.13, 0.7},  {3, 7.79, -2.689, 0.7},
    {4, 7.79, 2.689, 0.7}, {5, 7.96, 0.0, 3.189}, {6, 0.0, 0.0, 0.0},
};

static void print(const double *numbers, size_t count) {
  for (size_t i = 0; i < count; i++) printf(" %.17g", numbers[i]);
}

int main(void) {
  const tanker_pose_Camera camera = {
      .fx = 571.0, .fy = 571.0, .cx = 254.0, .cy = 206.0, .width = 508, .height = 412};
  const tanker_pose_Options options = tanker_pose_default_options();
  tanker_pose_Estimator *estimator = NULL;
  char why[256];
  if (tanker_pose_create(&camera, markers, sizeof markers / sizeof markers[0], &options, &estimator,
                         why, sizeof why) != TANKER_POSE_STATUS_OK) {
    fprintf(stderr, "solve_frames: %s\n", why);
    return 1;
  }

  int result = 0;
  unsigned count;
  while (result == 0 && scanf("%u", &count) == 1) {
    tanker_pose_Detection seen[TANKER_POSE_MOST_DETECTIONS];
    if (count > TANKER_POSE_MOST_DETECTIONS) {
      fprintf(stderr, "solve_frames: expected at most %d detections, got %u\n",
              (int)TANKER_POSE_MOST_DETECTIONS, count);
      result = 1;
      break;
    }
    memset(seen, 0, sizeof seen);
    for (unsigned i = 0; i < count; i++) {
      if (scanf("%u %lf %lf %lf", &seen[i].id, &seen[i].u, &seen[i].v, &seen[i].sigma) != 4) {
        fprintf(stderr, "solve_frames: expected id, column, row and sigma\n");
        result = 1;
      }
    }
    tanker_pose_Pose pose;
    if (result == 0 && tanker_pose_estimate(estimator, seen, count, &pose) != TANKER_POSE_STATUS_OK) {
      fprintf(stderr, "solve_frames: the estimator failed\n");
      result = 1;
    }
    if (result != 0) break;
    printf("%s", tanker_pose_outcome_name(pose.outcome));
    if (pose.outcome == TANKER_POSE_OUTCOME_OK) {
      print(pose.rotation, 9);
      print(pose.translation, 3);
      print(pose.covariance, 36);
    }
    printf("\n");
  }
  tanker_pose_destroy(estimator);
  return result;
}
