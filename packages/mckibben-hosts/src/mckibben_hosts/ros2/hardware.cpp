// NAME: muscles with their air as a hardware component of ros2_control, simulated.
//
// Compiled and run against a stub of hardware_interface that has the interface of ROS 2 Humble; not with ROS 2 itself.
//
// In read() the mechanism and the muscles go on by the period, in steps of at most the parameter "step" [s]. Of each joint
//   inertia * acceleration = load - damping * velocity - gravity * sin(position) + sum of arm * tension.
// For a real robot replace what read() and write() do by your valves and sensors; the interfaces stay the same.

#include <cmath>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "NAME.h"
#include "hardware_interface/handle.hpp"
#include "hardware_interface/hardware_info.hpp"
#include "hardware_interface/system_interface.hpp"
#include "hardware_interface/types/hardware_interface_return_values.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_lifecycle/state.hpp"

namespace NAME
{
using CallbackReturn = hardware_interface::CallbackReturn;
using hardware_interface::return_type;

struct MuscleRow
{
  const char * name;
  double span, shortest, longest;
  double NAME_inputs::*span_in;
  double NAME_inputs::*rate_in;
  double NAME_outputs::*tension_out;
  double NAME_outputs::*pressure_out;
};
const MuscleRow MUSCLES[] = {
MUSCLEROWS
};

struct CommandRow
{
  const char * name;
  double NAME_inputs::*command_in;
};
const CommandRow COMMANDS[] = {
COMMANDROWS
};

struct ParameterRow
{
  const char * path;
  double NAME_parameters::*member;
  double low, high;
};
const ParameterRow PARAMETERS[] = {
PARAMETERROWS
};

struct Joint
{
  std::string name;
  double inertia, damping, gravity, load, start;
  std::vector<double> arms;  // of each muscle [m]
  double position = 0.0, velocity = 0.0, effort = 0.0;
};

struct MuscleState
{
  double zero_span = 0.0, span = 0.0, pressure = 0.0, tension = 0.0;
};

class MuscleSystem : public hardware_interface::SystemInterface
{
public:
  CallbackReturn on_init(const hardware_interface::HardwareInfo & info) override
  {
    if (hardware_interface::SystemInterface::on_init(info) != CallbackReturn::SUCCESS) return CallbackReturn::ERROR;
    try {
      configure();
    } catch (const std::invalid_argument & error) {
      RCLCPP_FATAL(rclcpp::get_logger("NAME"), "%s", error.what());
      return CallbackReturn::ERROR;
    }
    rest();
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    rest();
    return CallbackReturn::SUCCESS;
  }

  std::vector<hardware_interface::StateInterface> export_state_interfaces() override
  {
    std::vector<hardware_interface::StateInterface> shown;
    for (std::size_t j = 0; j < joints_.size(); ++j)
      for (const auto & one : info_.joints[j].state_interfaces)
        shown.emplace_back(joints_[j].name, one.name, joint_value(joints_[j], one.name));
    for (const auto & gpio : info_.gpios)
      for (const auto & one : gpio.state_interfaces)
        shown.emplace_back(gpio.name, one.name, muscle_value(gpio.name, one.name));
    return shown;
  }

  std::vector<hardware_interface::CommandInterface> export_command_interfaces() override
  {
    std::vector<hardware_interface::CommandInterface> taken;
    for (const auto & gpio : info_.gpios)
      for (std::size_t k = 0; k < std::size(COMMANDS); ++k)
        if (!gpio.command_interfaces.empty() && gpio.name == COMMANDS[k].name)
          taken.emplace_back(gpio.name, gpio.command_interfaces[0].name, &commands_[k]);
    return taken;
  }

  return_type read(const rclcpp::Time &, const rclcpp::Duration & period) override
  {
    const double whole = period.seconds();
    if (!(whole > 0.0)) return return_type::OK;
    const int count = static_cast<int>(std::ceil(whole / step_ - 1e-9));
    for (int k = 0; k < count; ++k)
      if (!advance(whole / count)) return return_type::ERROR;
    return return_type::OK;
  }

  return_type write(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    for (std::size_t k = 0; k < std::size(COMMANDS); ++k)
      if (std::isfinite(commands_[k])) inputs_.*COMMANDS[k].command_in = commands_[k];
    return return_type::OK;
  }

private:
  using Words = std::unordered_map<std::string, std::string>;

  static double number(const Words & words, const std::string & where, const std::string & key, double usual, double low)
  {
    const auto at = words.find(key);
    if (at == words.end()) return usual;
    std::size_t end = 0;
    double value = std::nan("");
    try {
      value = std::stod(at->second, &end);
    } catch (const std::exception &) {
      end = 0;
    }
    if (end != at->second.size() || end == 0 || !std::isfinite(value) || value < low)
      throw std::invalid_argument(
        where + ": " + key + " must be a number of at least " + std::to_string(low) + ", got '" + at->second + "'");
    return value;
  }

  void configure()
  {
    step_ = number(info_.hardware_parameters, info_.name, "step", LONGEST, 1e-6);
    parameters_ = NAME_default_parameters;
    for (const auto & word : info_.hardware_parameters) {
      if (word.first == "step") continue;
      const ParameterRow * found = nullptr;
      for (const auto & row : PARAMETERS)
        if (word.first == row.path) found = &row;
      if (found == nullptr) throw std::invalid_argument(info_.name + ": unknown parameter '" + word.first + "'");
      const double value = number(info_.hardware_parameters, info_.name, word.first, 0.0, found->low);
      if (value > found->high)
        throw std::invalid_argument(
          info_.name + ": " + word.first + " must be at most " + std::to_string(found->high) + ", got '" +
          word.second + "'");
      parameters_.*found->member = value;
    }
    joints_.clear();
    for (const auto & stated : info_.joints) {
      const Words & words = stated.parameters;
      Joint joint;
      joint.name = stated.name;
      joint.inertia = number(words, stated.name, "inertia", -1.0, 1e-9);
      if (joint.inertia < 0.0) throw std::invalid_argument(stated.name + ": inertia is missing");
      joint.damping = number(words, stated.name, "damping", 0.0, 0.0);
      joint.gravity = number(words, stated.name, "gravity", 0.0, 0.0);
      joint.load = number(words, stated.name, "load", 0.0, -1e6);
      joint.start = number(words, stated.name, "position", 0.0, -1e3);
      for (const auto & muscle : MUSCLES)
        joint.arms.push_back(number(words, stated.name, std::string("arm.") + muscle.name, 0.0, -10.0));
      for (const auto & word : words)
        if (word.first.rfind("arm.", 0) == 0 && muscle_index(word.first.substr(4)) < 0)
          throw std::invalid_argument(stated.name + ": unknown muscle '" + word.first.substr(4) + "'");
      for (const auto & one : stated.state_interfaces)
        if (joint_value(joint, one.name) == nullptr)
          throw std::invalid_argument(
            stated.name + ": state interface must be position, velocity or effort, got '" + one.name + "'");
      if (!stated.command_interfaces.empty())
        throw std::invalid_argument(stated.name + ": a joint has no command interface; the valves have them");
      joints_.push_back(joint);
    }
    muscles_.assign(std::size(MUSCLES), MuscleState());
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i) muscles_[i].zero_span = MUSCLES[i].span;
    for (const auto & gpio : info_.gpios) {
      const int i = muscle_index(gpio.name);
      if (i >= 0) muscles_[i].zero_span = number(gpio.parameters, gpio.name, "span", MUSCLES[i].span, 1e-6);
      for (const auto & one : gpio.state_interfaces)
        if (muscle_value(gpio.name, one.name) == nullptr)
          throw std::invalid_argument(gpio.name + ": unknown state interface '" + one.name + "'");
      bool is_command = false;
      for (const auto & row : COMMANDS) is_command = is_command || gpio.name == row.name;
      if (!gpio.command_interfaces.empty() && !is_command)
        throw std::invalid_argument(gpio.name + ": the part has no such command");
    }
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i) {
      double length = muscles_[i].zero_span;
      for (const auto & joint : joints_) length -= joint.arms[i] * joint.start;
      if (!(length >= MUSCLES[i].shortest && length <= MUSCLES[i].longest))
        throw std::invalid_argument(
          std::string(MUSCLES[i].name) + ": its span at the start must be from " + std::to_string(MUSCLES[i].shortest) +
          " m to " + std::to_string(MUSCLES[i].longest) + " m, got " + std::to_string(length) + " m");
    }
    commands_.assign(std::size(COMMANDS), 0.0);
  }

  void rest()
  {
    state_ = NAME_state{};  // zeros: at rest at the first spans
    inputs_ = NAME_default_inputs;
    for (std::size_t k = 0; k < std::size(COMMANDS); ++k) commands_[k] = inputs_.*COMMANDS[k].command_in;
    for (auto & joint : joints_) {
      joint.position = joint.start;
      joint.velocity = joint.effort = 0.0;
    }
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i) {
      muscles_[i].span = span(i);
      muscles_[i].pressure = muscles_[i].tension = 0.0;
    }
  }

  double span(std::size_t i) const
  {
    double length = muscles_[i].zero_span;
    for (const auto & joint : joints_) length -= joint.arms[i] * joint.position;
    return length;
  }

  bool advance(double h)
  {
    NAME_outputs out;
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i) {
      double rate = 0.0;
      for (const auto & joint : joints_) rate -= joint.arms[i] * joint.velocity;
      inputs_.*MUSCLES[i].span_in = span(i);
      inputs_.*MUSCLES[i].rate_in = rate;
    }
    NAME_step(&parameters_, &state_, &inputs_, h, UPPER_SYNCHRONOUS, &out);
    if (out.sound != 1.0) {
      RCLCPP_ERROR(rclcpp::get_logger("NAME"), SENTENCE, h, NAME_meaning(out.sound));
      return false;
    }
    for (auto & joint : joints_) {
      joint.effort = 0.0;
      for (std::size_t i = 0; i < std::size(MUSCLES); ++i) joint.effort += joint.arms[i] * (out.*MUSCLES[i].tension_out);
      const double before = joint.velocity;
      const double moment = joint.load - joint.damping * before - joint.gravity * std::sin(joint.position) + joint.effort;
      joint.velocity += h * moment / joint.inertia;
      joint.position += 0.5 * h * (before + joint.velocity);
    }
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i) {
      muscles_[i].span = span(i);
      muscles_[i].pressure = out.*MUSCLES[i].pressure_out;
      muscles_[i].tension = out.*MUSCLES[i].tension_out;
    }
    return true;
  }

  static int muscle_index(const std::string & name)
  {
    for (std::size_t i = 0; i < std::size(MUSCLES); ++i)
      if (name == MUSCLES[i].name) return static_cast<int>(i);
    return -1;
  }

  static double * joint_value(Joint & joint, const std::string & name)
  {
    if (name == "position") return &joint.position;
    if (name == "velocity") return &joint.velocity;
    return name == "effort" ? &joint.effort : nullptr;
  }

  double * muscle_value(const std::string & muscle, const std::string & name)
  {
    const int i = muscle_index(muscle);
    if (i < 0) return nullptr;
    if (name == "pressure") return &muscles_[i].pressure;
    if (name == "tension") return &muscles_[i].tension;
    return name == "span" ? &muscles_[i].span : nullptr;
  }

  double step_ = LONGEST;
  std::vector<Joint> joints_;
  std::vector<MuscleState> muscles_;
  std::vector<double> commands_;
  NAME_parameters parameters_ = NAME_default_parameters;
  NAME_inputs inputs_ = NAME_default_inputs;
  NAME_state state_ = {};
};
}  // namespace NAME

PLUGINLIB_EXPORT_CLASS(NAME::MuscleSystem, hardware_interface::SystemInterface)
