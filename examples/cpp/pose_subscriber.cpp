#include <chrono>
#include <cmath>
#include <geometry_msgs/msg/pose_with_covariance_stamped.hpp>
#include <rclcpp/rclcpp.hpp>
#include <tanker_pose/msg/estimator_status.hpp>

using geometry_msgs::msg::PoseWithCovarianceStamped;
using tanker_pose::msg::EstimatorStatus;
using Clock = std::chrono::steady_clock;

int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  auto node = std::make_shared<rclcpp::Node>("pose_subscriber");
  auto latest = Clock::now();
  auto pose = node->create_subscription<PoseWithCovarianceStamped>(
    "pose", 10, [&](PoseWithCovarianceStamped::ConstSharedPtr message) {  // for trusted frames only
      latest = Clock::now();
      const double sigma_z = std::sqrt(message->pose.covariance[14]);  // row 2, column 2
      if (sigma_z > 0.5) return;  // m; your own limit
      RCLCPP_INFO(
        node->get_logger(), "%.2f m ahead, sigma %.2f m", message->pose.pose.position.z, sigma_z);
    });
  auto status = node->create_subscription<EstimatorStatus>(
    "status", 10, [&](EstimatorStatus::ConstSharedPtr message) {  // for every frame
      if (message->outcome != EstimatorStatus::OK)
        RCLCPP_WARN(node->get_logger(), "no pose (%d): %s", message->outcome, message->message.c_str());
    });
  // When detections stop, neither pose nor status comes.
  auto timer = node->create_wall_timer(std::chrono::seconds(1), [&]() {
    const double age = std::chrono::duration<double>(Clock::now() - latest).count();
    if (age > 2.0) RCLCPP_WARN(node->get_logger(), "no pose for %.0f s", age);
  });
  rclcpp::spin(node);
  rclcpp::shutdown();
}
