// The estimator of tanker_pose for C. cbindgen writes it from crates/tanker_pose_c/src: do not edit.

#ifndef TANKER_POSE_H
#define TANKER_POSE_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Most detections of a frame.
#define TANKER_POSE_MOST_DETECTIONS 64

// Most coefficients of a lens.
#define TANKER_POSE_MOST_COEFFICIENTS 8

// Pinhole, without coefficients.
#define TANKER_POSE_LENS_NONE 0

// `plumb_bob`: k1, k2, p1, p2, k3.
#define TANKER_POSE_LENS_PLUMB_BOB 1

// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6.
#define TANKER_POSE_LENS_RATIONAL_POLYNOMIAL 2

// `equidistant`: k1, k2, k3, k4.
#define TANKER_POSE_LENS_EQUIDISTANT 3

// Start at the nominal attitude.
#define TANKER_POSE_INITIALISATION_NOMINAL 1

// Start at the linear camera matrix; 6 points, not in one plane.
#define TANKER_POSE_INITIALISATION_DLT 2

// Start at the last trusted attitude of this estimator, or else the nominal one.
#define TANKER_POSE_INITIALISATION_PREVIOUS 3

// The best of all attitudes.
#define TANKER_POSE_INITIALISATION_GLOBAL 4

// The outcome of a frame with a trusted pose.
#define TANKER_POSE_OUTCOME_OK 0

// Whether a call did what it is for.
typedef enum {
  // It did.
  TANKER_POSE_STATUS_OK = 0,
  // A pointer is null, or not aligned.
  TANKER_POSE_STATUS_NULL_POINTER = 1,
  // The camera cannot be used.
  TANKER_POSE_STATUS_INVALID_CAMERA = 2,
  // The markers cannot be used: fewer than three, an id twice, an implausible coordinate, all of them on one line.
  TANKER_POSE_STATUS_INVALID_MARKERS = 3,
  // An option is out of its range.
  TANKER_POSE_STATUS_INVALID_OPTIONS = 4,
  // More detections than `TANKER_POSE_MOST_DETECTIONS`.
  TANKER_POSE_STATUS_TOO_MANY_DETECTIONS = 5,
  // A defect of this library.
  TANKER_POSE_STATUS_INTERNAL = 6,
} TANKER_POSE_STATUS;

// An estimator for one camera and one set of markers, with room for a frame.
typedef struct tanker_pose_Estimator tanker_pose_Estimator;

// How a pose is found and judged: the node's parameters of the same names, docs/parameters.md.
typedef struct {
  // Expected rotation of `camera_from_tanker`, row by row.
  double nominal_camera_from_tanker[9];
  // Standard deviation of detections that do not state one, px.
  double pixel_sigma_px;
  // Detections closer than this to the edge of the image are left out, px; 0: none.
  double edge_margin_px;
  // Probability that a correct frame passes the chi-squared test.
  double trust_probability;
  // Frames with a second pose of at least this likelihood are refused; 1: never.
  double max_ambiguity;
  // One of `TANKER_POSE_INITIALISATION_...`.
  uint32_t initialisation;
  // Fewer detections of similar sigma give no pose.
  uint32_t min_points;
  // At most this many detections of a frame are left out as wrong, 0 to 2.
  uint32_t max_outliers;
  // Not 0: prove that no other pose in front of the camera has a lower cost.
  uint32_t certify;
  // Not 0: refuse poses without that proof.
  uint32_t require_certificate;
} tanker_pose_Options;

// A camera, px; the centre of the top-left pixel is (0, 0).
typedef struct {
  // Focal length along columns, px.
  double fx;
  // Focal length along rows, px.
  double fy;
  // Column of the principal point, px.
  double cx;
  // Row of the principal point, px.
  double cy;
  // Coefficients of the lens in the order of `sensor_msgs/CameraInfo`; the rest 0.
  double d[TANKER_POSE_MOST_COEFFICIENTS];
  // One of `TANKER_POSE_LENS_...`.
  uint32_t lens;
  // Width of the image, px; 0: unknown, and no detection is left out at an edge.
  uint32_t width;
  // Height of the image, px.
  uint32_t height;
} tanker_pose_Camera;

// A marker on the tanker: x forward, y left, z up; m.
typedef struct {
  // Its id.
  uint32_t id;
  // Forward, m.
  double x;
  // To the left, m.
  double y;
  // Up, m.
  double z;
} tanker_pose_Marker;

// A detected marker in an image.
typedef struct {
  // Id of its marker.
  uint32_t id;
  // Column, px.
  double u;
  // Row, px.
  double v;
  // Standard deviation of column and of row, px; 0: `pixel_sigma_px` of the options.
  double sigma;
} tanker_pose_Detection;

// The outcome of a frame, and its pose if it has one.
typedef struct {
  // Rotation of `camera_from_tanker`, row by row; NaN without a trusted pose, as are the next two.
  double rotation[9];
  // The tanker's origin in the camera's optical frame (x right, y down, z ahead), m.
  double translation[3];
  // Row by row in ROS's order: x, y, z, and rotations about the camera's x, y, z; m, rad.
  double covariance[36];
  // Root mean square of the residuals, px; NaN without a fit, as are the next three.
  double rms_px;
  // Sum of the squared residuals over their variances.
  double chi_squared;
  // The largest `chi_squared` that is trusted.
  double chi_squared_limit;
  // Likelihood of the second-best pose relative to this one.
  double ambiguity;
  // A constant of `tanker_pose/msg/EstimatorStatus`: `TANKER_POSE_OUTCOME_OK`, or why there is no pose; its name: `tanker_pose_outcome_name`.
  uint32_t outcome;
  // Of `chi_squared`.
  uint32_t degrees_of_freedom;
  // Of all solver stages.
  uint32_t iterations;
  // 0: no proof was asked for, 1: proven the best, 2: not proven, 3: proven, for a better pose that a search found.
  uint32_t certificate;
  // How many detections the pose rests on.
  uint32_t used;
} tanker_pose_Pose;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the default options: those of the node.
tanker_pose_Options tanker_pose_default_options(void);

// Returns the name of an outcome, as `tanker_pose/msg/EstimatorStatus` has it; "UNKNOWN" for other numbers.
const char *tanker_pose_outcome_name(uint32_t outcome);

// Makes an estimator for one camera and these markers, and puts it into `*made`; allocates. With any other status than
// `TANKER_POSE_STATUS_OK` `*made` is null and `message`, if it is not null, says why in at most `message_size` bytes.
//
// # Safety
// `camera` and `options` are null or point to such structs, `markers` to `marker_count` of them, `made` is null or points
// to a place for a pointer, `message` is null or points to `message_size` bytes. None of them overlap.
TANKER_POSE_STATUS tanker_pose_create(const tanker_pose_Camera *camera,
                                      const tanker_pose_Marker *markers,
                                      size_t marker_count,
                                      const tanker_pose_Options *options,
                                      tanker_pose_Estimator **made,
                                      char *message,
                                      size_t message_size);

// Ends an estimator; null does nothing.
//
// # Safety
// `estimator` is null, or from [`tanker_pose_create`] and not yet ended, and no other call uses it.
void tanker_pose_destroy(tanker_pose_Estimator *estimator);

// Estimates one frame into `*pose`. `TANKER_POSE_STATUS_OK` means that the frame has an outcome: only with
// `TANKER_POSE_OUTCOME_OK` in `pose->outcome` is there a pose, in every other case its numbers are NaN. Allocates nothing
// for up to `TANKER_POSE_MOST_DETECTIONS` detections; more are refused. One thread at a time may use an estimator.
//
// # Safety
// `estimator` is null or from [`tanker_pose_create`] and not yet ended, and no other call uses it; `detections` is null or
// points to `detection_count` structs, `pose` is null or points to a place for a struct.
TANKER_POSE_STATUS tanker_pose_estimate(tanker_pose_Estimator *estimator,
                                        const tanker_pose_Detection *detections,
                                        size_t detection_count,
                                        tanker_pose_Pose *pose);

// Forgets the last trusted attitude, where `TANKER_POSE_INITIALISATION_PREVIOUS` starts: the next frame is the first.
//
// # Safety
// `estimator` is null or from [`tanker_pose_create`] and not yet ended, and no other call uses it.
TANKER_POSE_STATUS tanker_pose_reset(tanker_pose_Estimator *estimator);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TANKER_POSE_H */
