// A stub: makes the exported component known to the program that it is linked with, by one function.
#pragma once
#include <memory>

#define PLUGINLIB_EXPORT_CLASS(component, base) \
  std::unique_ptr<base> make_component() { return std::make_unique<component>(); }
