// A stub: what exported components use of rclcpp_lifecycle.
#pragma once

namespace rclcpp_lifecycle
{
class State
{
};
}  // namespace rclcpp_lifecycle
