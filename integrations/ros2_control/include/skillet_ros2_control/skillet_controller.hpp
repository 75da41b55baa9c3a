// A controller of ros2_control that makes a robot with effort interfaces the plant of a Skillet cell.

#ifndef SKILLET_ROS2_CONTROL__SKILLET_CONTROLLER_HPP_
#define SKILLET_ROS2_CONTROL__SKILLET_CONTROLLER_HPP_

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "skillet_plant.h"
#include "std_msgs/msg/bool.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace skillet_ros2_control
{

/// Sends the state of the joints to Skillet every cycle and commands the torques it answers with.
///
/// update() does not allocate or lock, and waits for an answer at most `patience_us`. A separate thread opens and
/// closes the connection. Whenever there is no torque, hold() takes over.
class SkilletController : public controller_interface::ControllerInterface
{
public:
  ~SkilletController() override;

  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;

  controller_interface::CallbackReturn on_init() override;
  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State & previous) override;
  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State & previous) override;
  controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State & previous) override;
  controller_interface::CallbackReturn on_cleanup(const rclcpp_lifecycle::State & previous) override;
  controller_interface::CallbackReturn on_error(const rclcpp_lifecycle::State & previous) override;
  controller_interface::CallbackReturn on_shutdown(const rclcpp_lifecycle::State & previous) override;

  controller_interface::return_type update(
    const rclcpp::Time & time, const rclcpp::Duration & period) override;

private:
  using Torques = std::array<double, SKILLET_JOINTS>;

  /// Also says who owns `plant_`: update() in kOpen, nobody in kFailed, kStopped and kSilent, otherwise the thread.
  enum class Link
  {
    kIdle,
    kWanted,   // on_activate() requested a connection
    kOpen,
    kFailed,   // `error_` says why
    kStopped,  // Skillet's controller ended cleanly
    kSilent,   // no torque for longer than `hold_max_s`
    kClosing,  // on_deactivate() requested the end
  };

  /// The last pose of the object.
  struct Object
  {
    std::array<double, 3> position{};             // m, in the frame of the arm's base
    std::array<double, 4> quaternion{1, 0, 0, 0};  // w, x, y, z
    bool in_contact = false;
    bool is_new = false;
  };

  void create_ros_interfaces();
  bool read_state();
  void read_object(double dt_s);
  int ask(const rclcpp::Duration & period, Torques & tau);
  void follow(const Torques & tau, double dt_s);
  Torques hold() const;
  void write(const Torques & wanted, double dt_s);

  void connect_and_close();
  void end_thread();

  std::size_t n_ = 0;
  std::vector<std::string> joints_;
  std::string cell_;
  Torques limits_{};         // N·m
  double torque_rate_ = 0;   // torque limits per s
  double hold_damping_ = 0;  // torque limits per rad/s
  double hold_max_s_ = 0;
  std::uint32_t patience_us_ = 0;

  skillet_description description_{};
  skillet_plant * plant_ = nullptr;
  std::array<char, 512> error_{};
  std::atomic<Link> link_{Link::kIdle};
  std::atomic<bool> is_ending_{false};
  std::thread thread_;

  skillet_sample sample_{};
  Torques written_{};  // N·m, last commanded
  Torques rest_{};     // N·m, estimate of gravity
  double held_s_ = 0;

  std::mutex object_mutex_;  // guards `object_`; update() only tries to lock it
  Object object_;
  double object_age_s_ = 0;
  bool has_object_ = false;

  std::atomic<bool> is_resetting_{false};
  std::atomic<bool> has_reset_{false};
  rclcpp::Service<std_srvs::srv::Trigger>::SharedPtr reset_done_;
  rclcpp::Subscription<geometry_msgs::msg::PoseStamped>::SharedPtr poses_;
  rclcpp::Subscription<std_msgs::msg::Bool>::SharedPtr contacts_;
};

}  // namespace skillet_ros2_control

#endif  // SKILLET_ROS2_CONTROL__SKILLET_CONTROLLER_HPP_
