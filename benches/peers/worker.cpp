// Worker of the peers benchmark: OpenCV without Python and, where its source is at hand, SQPnP by its authors.
//
//   worker FRAMES    answers the same lines as the Rust worker: methods, time, poses
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <time.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#ifdef PEER_SQPNP
#include <sqpnp.h>
#endif

constexpr double kBlockSeconds = 4e-3;

// CPU time of this thread: what others do on the machine at the same time is not the method's.
double seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Frame {
  std::vector<cv::Point3d> markers;
  std::vector<cv::Point2d> pixels;
  cv::Vec3d prior_rotation, prior_translation;
#ifdef PEER_SQPNP
  std::vector<sqpnp::_Point> sqpnp_points;
  std::vector<sqpnp::_Projection> sqpnp_rays;
#endif
};

struct Pose {
  cv::Matx33d rotation;
  cv::Vec3d translation;
};

struct Frames {
  cv::Matx33d camera;
  std::vector<std::vector<Frame>> sizes;
};

Frames read(const char * path) {
  std::ifstream file(path, std::ios::binary);
  auto next = [&] {
    double value;
    if (!file.read(reinterpret_cast<char *>(&value), sizeof value)) throw std::runtime_error("frames end early");
    return value;
  };
  Frames frames;
  const double fx = next(), fy = next(), cx = next(), cy = next();
  frames.camera = {fx, 0, cx, 0, fy, cy, 0, 0, 1};
  frames.sizes.resize(static_cast<size_t>(next()));
  for (auto & size : frames.sizes) {
    const auto points = static_cast<size_t>(next());
    size.resize(static_cast<size_t>(next()));
    for (auto & frame : size) {
      for (int i = 0; i < 12; ++i) next();  // the truth is not for solvers
      cv::Matx33d rotation;
      for (double & value : rotation.val) value = next();
      cv::Rodrigues(rotation, frame.prior_rotation);
      for (double & value : frame.prior_translation.val) value = next();
      for (size_t i = 0; i < points; ++i) {
        const double x = next(), y = next(), z = next(), u = next(), v = next(), ray_x = next(), ray_y = next();
        frame.markers.emplace_back(x, y, z);
        frame.pixels.emplace_back(u, v);
#ifdef PEER_SQPNP
        frame.sqpnp_points.emplace_back(x, y, z);
        frame.sqpnp_rays.emplace_back(ray_x, ray_y);
#else
        (void)ray_x, (void)ray_y;
#endif
      }
    }
  }
  return frames;
}

using Solve = std::function<bool(const Frame &, Pose &)>;

std::map<std::string, Solve> methods(const Frames & frames) {
  const cv::Mat camera(frames.camera);
  // A pose as OpenCV gives it, turned into a matrix: every peer ends with one.
  auto finish = [](const cv::Mat & rotation, const cv::Mat & translation, Pose & pose) {
    cv::Rodrigues(rotation, pose.rotation);
    pose.translation = cv::Vec3d(translation.ptr<double>());
    return true;
  };
  auto opencv = [=](int flag, bool refine, bool covariance) -> Solve {
    return [=](const Frame & frame, Pose & pose) {
      cv::Mat rotation, translation;
      if (!cv::solvePnP(frame.markers, frame.pixels, camera, cv::noArray(), rotation, translation, false, flag))
        return false;
      if (refine) cv::solvePnPRefineLM(frame.markers, frame.pixels, camera, cv::noArray(), rotation, translation);
      if (covariance) {
        std::vector<cv::Point2d> projected;
        cv::Mat jacobian;
        cv::projectPoints(frame.markers, rotation, translation, camera, cv::noArray(), projected, jacobian);
        const cv::Mat pose_jacobian = jacobian.colRange(0, 6);
        cv::Mat information;
        cv::mulTransposed(pose_jacobian, information, true);
        const cv::Mat result = information.inv(cv::DECOMP_CHOLESKY) * 0.25;
        if (!(result.at<double>(0, 0) > 0)) return false;
      }
      return finish(rotation, translation, pose);
    };
  };
  std::map<std::string, Solve> all;
  all["cv_sqpnp"] = opencv(cv::SOLVEPNP_SQPNP, false, false);
  all["cv_sqpnp_lm"] = opencv(cv::SOLVEPNP_SQPNP, true, false);
  all["cv_sqpnp_lm_cov"] = opencv(cv::SOLVEPNP_SQPNP, true, true);
  all["cv_epnp"] = opencv(cv::SOLVEPNP_EPNP, false, false);
  all["cv_iterative"] = [=](const Frame & frame, Pose & pose) {
    cv::Mat rotation(frame.prior_rotation, true), translation(frame.prior_translation, true);
    return cv::solvePnP(frame.markers, frame.pixels, camera, cv::noArray(), rotation, translation, true,
                        cv::SOLVEPNP_ITERATIVE) &&
           finish(rotation, translation, pose);
  };
#ifdef PEER_SQPNP
  all["authors_sqpnp"] = [](const Frame & frame, Pose & pose) {
    sqpnp::PnPSolver solver(frame.sqpnp_points, frame.sqpnp_rays);
    if (!solver.IsValid() || !solver.Solve() || solver.NumberOfSolutions() < 1) return false;
    // Several solutions of equal cost: the first, as its examples do.
    const sqpnp::SQPSolution & best = *solver.SolutionPtr(0);
    pose.rotation = cv::Matx33d(best.r_hat.data());
    pose.translation = cv::Vec3d(best.t.data());
    return true;
  };
#endif
  return all;
}

volatile double sink;

double ns_per_solve(const Solve & solve, const std::vector<Frame> & frames) {
  Pose pose;
  auto pass = [&] {
    for (const Frame & frame : frames) {
      solve(frame, pose);
      sink = pose.translation[0];
    }
  };
  pass();
  const double begin = seconds();
  auto elapsed = [&] { return seconds() - begin; };
  int passes = 0;
  while (elapsed() < kBlockSeconds) {
    pass();
    ++passes;
  }
  return elapsed() * 1e9 / passes / static_cast<double>(frames.size());
}

int main(int count, char ** arguments) {
  if (count != 2) return std::fprintf(stderr, "usage: worker FRAMES\n"), 2;
  cv::setNumThreads(1);
  const Frames frames = read(arguments[1]);
  const auto known = methods(frames);
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string command, method;
    size_t size = 0;
    words >> command >> method >> size;
    if (command == "version") {
      std::cout << "OpenCV " << CV_VERSION << std::endl;
    } else if (command == "methods") {
      for (const auto & entry : known) std::cout << entry.first << ' ';
      std::cout << std::endl;
    } else if (command == "time") {
      std::cout << ns_per_solve(known.at(method), frames.sizes.at(size)) << std::endl;
    } else if (command == "poses") {
      for (const Frame & frame : frames.sizes.at(size)) {
        Pose pose;
        if (known.at(method)(frame, pose)) {
          for (double value : pose.rotation.val) std::printf("%.17g ", value);
          std::printf("%.17g %.17g %.17g\n", pose.translation[0], pose.translation[1], pose.translation[2]);
        } else {
          std::printf("none\n");
        }
      }
      std::fflush(stdout);
    } else {
      return std::fprintf(stderr, "what does '%s' mean?\n", line.c_str()), 2;
    }
  }
}
