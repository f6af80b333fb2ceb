// Loads a component as the resource manager of ros2_control does, moves it, and prints what its interfaces show.
// Arguments: KEY=VALUE of the hardware, joint.KEY=VALUE, steps, period [s], then a command for each command interface.
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "hardware_interface/system_interface.hpp"

std::unique_ptr<hardware_interface::SystemInterface> make_component();

int main(int argc, char ** argv)
{
  hardware_interface::HardwareInfo info;
  info.name = "tested";
  hardware_interface::ComponentInfo joint;
  joint.name = "joint";
  for (const char * shown : {"position", "velocity", "effort"}) joint.state_interfaces.push_back({shown});
  std::vector<std::string> rest;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    const auto at = word.find('=');
    if (at == std::string::npos)
      rest.push_back(word);
    else if (word.rfind("joint.", 0) == 0)
      joint.parameters[word.substr(6, at - 6)] = word.substr(at + 1);
    else
      info.hardware_parameters[word.substr(0, at)] = word.substr(at + 1);
  }
  info.joints.push_back(joint);
  for (const char * name : {"flexor", "extensor"}) {
    hardware_interface::ComponentInfo gpio;
    gpio.name = name;
    for (const char * shown : {"pressure", "tension", "span"}) gpio.state_interfaces.push_back({shown});
    gpio.command_interfaces.push_back({"command"});
    gpio.parameters["span"] = "0.135";
    info.gpios.push_back(gpio);
  }
  const auto component = make_component();
  if (component->on_init(info) != hardware_interface::CallbackReturn::SUCCESS) return 2;
  auto states = component->export_state_interfaces();
  auto commands = component->export_command_interfaces();
  component->on_activate(rclcpp_lifecycle::State());
  const int steps = std::atoi(rest.at(0).c_str());
  const rclcpp::Duration period(std::atof(rest.at(1).c_str()));
  for (std::size_t k = 0; k < commands.size(); ++k) commands[k].set_value(std::atof(rest.at(2 + k).c_str()));
  component->write(rclcpp::Time(), period);
  for (int k = 0; k < steps; ++k) {
    if (component->read(rclcpp::Time(), period) != hardware_interface::return_type::OK) return 1;
    component->write(rclcpp::Time(), period);
  }
  for (const auto & one : states) std::printf("%s %.17g\n", one.get_name().c_str(), one.get_value());
  return 0;
}
