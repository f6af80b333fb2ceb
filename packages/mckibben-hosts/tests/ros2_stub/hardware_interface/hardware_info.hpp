// A stub: what exported components use of hardware_interface of ROS 2 Humble.
#pragma once
#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface
{
struct InterfaceInfo
{
  std::string name;
};

struct ComponentInfo
{
  std::string name;
  std::vector<InterfaceInfo> command_interfaces;
  std::vector<InterfaceInfo> state_interfaces;
  std::unordered_map<std::string, std::string> parameters;
};

struct HardwareInfo
{
  std::string name;
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints;
  std::vector<ComponentInfo> gpios;
};
}  // namespace hardware_interface
