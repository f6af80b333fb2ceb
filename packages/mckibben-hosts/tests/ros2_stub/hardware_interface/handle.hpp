// A stub: what exported components use of hardware_interface of ROS 2 Humble.
#pragma once
#include <string>

namespace hardware_interface
{
class Handle
{
public:
  Handle(const std::string & prefix, const std::string & name, double * value) : name_(prefix + "/" + name), value_(value) {}
  const std::string & get_name() const { return name_; }
  double get_value() const { return *value_; }

protected:
  std::string name_;
  double * value_;
};

class StateInterface : public Handle
{
public:
  using Handle::Handle;
};

class CommandInterface : public Handle
{
public:
  using Handle::Handle;
  CommandInterface(const CommandInterface &) = delete;
  CommandInterface(CommandInterface &&) = default;
  void set_value(double value) { *value_ = value; }
};
}  // namespace hardware_interface
