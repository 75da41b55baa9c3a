#include "skillet_ros2_control/skillet_controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>

#include "hardware_interface/types/hardware_interface_type_values.hpp"
#include "pluginlib/class_list_macros.hpp"

namespace skillet_ros2_control
{

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

namespace
{
/// Time constant of the filter behind rest_, s: longer than a throw, shorter than a move to the start.
constexpr double kRestFilterS = 0.5;
/// A pose older than this counts as not seen, s.
constexpr double kObjectAgeMaxS = 0.1;
/// Poll interval of the connection thread.
constexpr std::chrono::milliseconds kLook{5};
/// State interfaces of each joint, in the order they are claimed.
constexpr std::array<const char *, 3> kStates{
  hardware_interface::HW_IF_POSITION, hardware_interface::HW_IF_VELOCITY, hardware_interface::HW_IF_EFFORT};
}  // namespace

SkilletController::~SkilletController() { end_thread(); }

InterfaceConfiguration SkilletController::command_interface_configuration() const
{
  InterfaceConfiguration claimed{interface_configuration_type::INDIVIDUAL, {}};
  for (const auto & joint : joints_) {
    claimed.names.push_back(joint + "/" + hardware_interface::HW_IF_EFFORT);
  }
  return claimed;
}

InterfaceConfiguration SkilletController::state_interface_configuration() const
{
  InterfaceConfiguration claimed{interface_configuration_type::INDIVIDUAL, {}};
  for (const auto & joint : joints_) {
    for (const char * state : kStates) {
      claimed.names.push_back(joint + "/" + state);
    }
  }
  return claimed;
}

CallbackReturn SkilletController::on_init()
{
  try {
    auto_declare<std::vector<std::string>>("joints", {});
    auto_declare<std::string>("cell", "");
    auto_declare<std::vector<double>>("torque_limits", {});
    auto_declare<bool>("has_object", false);
    auto_declare<double>("torque_rate", 200.0);
    auto_declare<double>("hold_damping", 0.1);
    auto_declare<double>("hold_max_s", 2.0);
    auto_declare<int>("patience_us", 200);
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_node()->get_logger(), "a parameter has the wrong type: %s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn SkilletController::on_configure(const rclcpp_lifecycle::State &)
{
  const auto node = get_node();
  const auto refuse = [&](const char * why) {
    RCLCPP_ERROR(node->get_logger(), "%s", why);
    return CallbackReturn::ERROR;
  };
  joints_ = node->get_parameter("joints").as_string_array();
  cell_ = node->get_parameter("cell").as_string();
  has_object_ = node->get_parameter("has_object").as_bool();
  const auto limits = node->get_parameter("torque_limits").as_double_array();
  torque_rate_ = node->get_parameter("torque_rate").as_double();
  hold_damping_ = node->get_parameter("hold_damping").as_double();
  hold_max_s_ = node->get_parameter("hold_max_s").as_double();
  const auto patience_us = node->get_parameter("patience_us").as_int();
  const auto rate_hz = get_update_rate();

  n_ = joints_.size();
  if (n_ < 1 || n_ > SKILLET_JOINTS) {
    return refuse("joints: Skillet takes 1 to 7, from the base outwards");
  }
  if (limits.size() != n_ || !std::all_of(limits.begin(), limits.end(), [](double limit) {
        return std::isfinite(limit) && limit > 0;
      })) {
    return refuse("torque_limits: one positive number a joint, N·m");
  }
  if (!(torque_rate_ > 0) || !(hold_damping_ > 0) || !(hold_max_s_ > 0)) {
    return refuse("torque_rate, hold_damping and hold_max_s must be positive");
  }
  if (rate_hz == 0) {
    return refuse("update_rate: it must be known, and be that of Skillet's controller");
  }
  if (patience_us < 0 || patience_us * static_cast<std::int64_t>(rate_hz) >= 1'000'000) {
    return refuse("patience_us: from 0 to less than a period");
  }
  patience_us_ = static_cast<std::uint32_t>(patience_us);

  std::copy(limits.begin(), limits.end(), limits_.begin());
  description_ = {};
  description_.name = "ros2_control";
  description_.cell = cell_.empty() ? nullptr : cell_.c_str();
  description_.n_joints = static_cast<int>(n_);
  description_.has_object = has_object_;
  description_.period_s = 1.0 / rate_hz;
  for (std::size_t i = 0; i < n_; i++) {
    description_.joint_names[i] = joints_[i].c_str();
    description_.torque_limits[i] = limits_[i];
  }

  create_ros_interfaces();
  thread_ = std::thread(&SkilletController::connect_and_close, this);
  return CallbackReturn::SUCCESS;
}

void SkilletController::create_ros_interfaces()
{
  const auto node = get_node();
  using Trigger = std_srvs::srv::Trigger;
  reset_done_ = node->create_service<Trigger>(
    "~/reset_done",
    [this](const Trigger::Request::SharedPtr, const Trigger::Response::SharedPtr response) {
      response->success = is_resetting_;
      response->message = response->success ? "" : "no reset is pending";
      has_reset_ = response->success;
    });
  if (!has_object_) {
    return;
  }
  poses_ = node->create_subscription<geometry_msgs::msg::PoseStamped>(
    "~/object", rclcpp::SensorDataQoS(),
    [this](const geometry_msgs::msg::PoseStamped::ConstSharedPtr seen) {
      const auto & p = seen->pose.position;
      const auto & q = seen->pose.orientation;
      const std::lock_guard lock(object_mutex_);
      object_.position = {p.x, p.y, p.z};
      object_.quaternion = {q.w, q.x, q.y, q.z};
      object_.is_new = true;
    });
  contacts_ = node->create_subscription<std_msgs::msg::Bool>(
    "~/in_contact", rclcpp::SensorDataQoS(), [this](const std_msgs::msg::Bool::ConstSharedPtr said) {
      const std::lock_guard lock(object_mutex_);
      object_.in_contact = said->data;
    });
}

CallbackReturn SkilletController::on_activate(const rclcpp_lifecycle::State &)
{
  if (link_ != Link::kIdle) {
    RCLCPP_ERROR(get_node()->get_logger(), "the previous connection is still closing: try again");
    return CallbackReturn::ERROR;
  }
  sample_ = {};
  if (!read_state()) {
    RCLCPP_ERROR(get_node()->get_logger(), "a position, velocity or effort is unreadable or not finite");
    return CallbackReturn::ERROR;
  }
  std::copy_n(sample_.q, SKILLET_JOINTS, description_.q);
  // Start from the torque that holds the arm now.
  std::copy_n(sample_.tau, SKILLET_JOINTS, rest_.begin());
  written_ = rest_;
  held_s_ = 0;
  object_age_s_ = std::numeric_limits<double>::infinity();
  is_resetting_ = has_reset_ = false;
  link_.store(Link::kWanted, std::memory_order_release);
  return CallbackReturn::SUCCESS;
}

CallbackReturn SkilletController::on_deactivate(const rclcpp_lifecycle::State &)
{
  const auto logger = get_node()->get_logger();
  switch (link_.exchange(Link::kClosing, std::memory_order_acq_rel)) {
    case Link::kFailed:
      RCLCPP_ERROR(logger, "%s", error_.data());
      break;
    case Link::kStopped:
      RCLCPP_INFO(logger, "Skillet's controller has ended");
      break;
    case Link::kSilent:
      RCLCPP_ERROR(logger, "no torque from Skillet for %.1f s", hold_max_s_);
      break;
    default:
      break;
  }
  is_resetting_ = false;
  return CallbackReturn::SUCCESS;
}

CallbackReturn SkilletController::on_cleanup(const rclcpp_lifecycle::State &)
{
  reset_done_.reset();
  poses_.reset();
  contacts_.reset();
  end_thread();
  return CallbackReturn::SUCCESS;
}

CallbackReturn SkilletController::on_error(const rclcpp_lifecycle::State & previous)
{
  return on_cleanup(previous);
}

CallbackReturn SkilletController::on_shutdown(const rclcpp_lifecycle::State & previous)
{
  return on_cleanup(previous);
}

return_type SkilletController::update(const rclcpp::Time &, const rclcpp::Duration & period)
{
  const double dt_s = std::max(period.seconds(), 0.0);
  read_object(dt_s);
  Torques tau{};
  const int code = read_state() ? ask(period, tau) : static_cast<int>(SKILLET_HOLD);
  const bool is_torque = (code == SKILLET_TORQUE || code == SKILLET_RESET) &&
                         std::all_of(tau.begin(), tau.begin() + n_, [](double x) { return std::isfinite(x); });
  if (is_torque) {
    follow(tau, dt_s);
    held_s_ = 0;
  } else {
    tau = hold();
    held_s_ += dt_s;
  }
  write(tau, dt_s);
  is_resetting_.store(code == SKILLET_RESET, std::memory_order_relaxed);

  if (code == SKILLET_ERROR || code == SKILLET_STOP) {
    return return_type::ERROR;
  }
  if (held_s_ > hold_max_s_) {
    link_.store(Link::kSilent, std::memory_order_release);
    return return_type::ERROR;
  }
  return return_type::OK;
}

/// Reads the joints into `sample_`. On failure returns false and leaves `sample_` as it was.
bool SkilletController::read_state()
{
  skillet_sample now = sample_;
  double * const into[kStates.size()] = {now.q, now.qd, now.tau};
  for (std::size_t i = 0; i < n_; i++) {
    for (std::size_t k = 0; k < kStates.size(); k++) {
      const auto value = state_interfaces_[i * kStates.size() + k].get_optional();
      if (!value || !std::isfinite(*value)) {
        return false;
      }
      into[k][i] = *value;
    }
  }
  sample_ = now;
  return true;
}

/// Adds the last pose of the object to `sample_`; skipped while a callback holds the lock.
void SkilletController::read_object(double dt_s)
{
  object_age_s_ += dt_s;
  if (const std::unique_lock lock(object_mutex_, std::try_to_lock); lock) {
    sample_.in_contact = object_.in_contact;
    if (object_.is_new) {
      std::copy(object_.position.begin(), object_.position.end(), sample_.object_position);
      std::copy(object_.quaternion.begin(), object_.quaternion.end(), sample_.object_quaternion);
      object_.is_new = false;
      object_age_s_ = 0;
    }
  }
  sample_.has_object = object_age_s_ <= kObjectAgeMaxS;
}

/// Sends the sample and returns the answer: a code of skillet_plant.h and, if it has one, the torque.
int SkilletController::ask(const rclcpp::Duration & period, Torques & tau)
{
  switch (link_.load(std::memory_order_acquire)) {
    case Link::kOpen:
      break;
    case Link::kFailed:
    case Link::kStopped:
      return SKILLET_ERROR;
    default:
      return SKILLET_HOLD;
  }
  // The plant's time must grow; the ROS clock may jump.
  sample_.t_ns += static_cast<std::uint64_t>(std::max<std::int64_t>(period.nanoseconds(), 1));
  if (has_reset_.exchange(false)) {
    skillet_plant_has_reset(plant_);
  }
  int code = skillet_plant_send(plant_, &sample_);
  if (code != SKILLET_ERROR) {
    code = skillet_plant_answer(plant_, patience_us_, tau.data());
  }
  if (code == SKILLET_ERROR) {
    std::strncpy(error_.data(), skillet_plant_error(plant_), error_.size() - 1);
    link_.store(Link::kFailed, std::memory_order_release);
  } else if (code == SKILLET_STOP) {
    link_.store(Link::kStopped, std::memory_order_release);
  }
  return code;
}

/// Low-pass filters the torque: an estimate of what holds the arm at rest.
void SkilletController::follow(const Torques & tau, double dt_s)
{
  const double share = dt_s / (kRestFilterS + dt_s);
  for (std::size_t i = 0; i < n_; i++) {
    rest_[i] += share * (tau[i] - rest_[i]);
  }
}

/// The controller's own hold: τ = τ_rest − D q̇. Without a model of the arm, gravity is only an estimate, so the arm
/// may drift slowly; `hold_max_s` limits how long.
SkilletController::Torques SkilletController::hold() const
{
  Torques tau{};
  for (std::size_t i = 0; i < n_; i++) {
    tau[i] = rest_[i] - hold_damping_ * limits_[i] * sample_.qd[i];
  }
  return tau;
}

/// Commands `wanted` within torque limits and rate. If an interface rejects a value, its last one stays.
void SkilletController::write(const Torques & wanted, double dt_s)
{
  for (std::size_t i = 0; i < n_; i++) {
    const double step = torque_rate_ * limits_[i] * dt_s;
    const double within = std::clamp(wanted[i], -limits_[i], limits_[i]);
    const double tau = written_[i] + std::clamp(within - written_[i], -step, step);
    if (command_interfaces_[i].set_value(tau)) {
      written_[i] = tau;
    }
  }
}

/// Body of the connection thread. Opening may take 30 s; neither belongs in update().
void SkilletController::connect_and_close()
{
  while (!is_ending_) {
    const Link link = link_.load(std::memory_order_acquire);
    if (link == Link::kWanted) {
      plant_ = skillet_plant_open(&description_, error_.data(), error_.size());
      Link expected = Link::kWanted;
      // If this fails, on_deactivate() came first and the next round closes the connection.
      link_.compare_exchange_strong(expected, plant_ ? Link::kOpen : Link::kFailed);
    } else if (link == Link::kClosing) {
      skillet_plant_close(plant_);
      plant_ = nullptr;
      link_.store(Link::kIdle, std::memory_order_release);
    }
    std::this_thread::sleep_for(kLook);
  }
  skillet_plant_close(plant_);
  plant_ = nullptr;
  link_.store(Link::kIdle, std::memory_order_release);
}

void SkilletController::end_thread()
{
  is_ending_ = true;
  if (thread_.joinable()) {
    thread_.join();
  }
  is_ending_ = false;
}

}  // namespace skillet_ros2_control

PLUGINLIB_EXPORT_CLASS(
  skillet_ros2_control::SkilletController, controller_interface::ControllerInterface)
