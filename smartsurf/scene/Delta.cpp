#include "smartsurf/scene/Delta.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace smartsurf::scene {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
constexpr double kDampingTime_s = 0.02;  // damping per stiffness by default

}  // namespace

const std::array<double, 3> Delta::kJointDirections{std::numbers::pi / 2, std::numbers::pi * 7 / 6,
                                                    std::numbers::pi * 11 / 6};

Delta::Delta(const ActuatorSpec& delta)
    : tip_shape(static_cast<DeltaTipShape>(static_cast<int>(delta.number("tip.shape")))),
      tip_radius(delta.number("tip.radius")),
      workspace_radius(delta.number("workspace.radius")),
      workspace_z{delta.numbers("workspace.z")[0], delta.numbers("workspace.z")[1]} {
  const auto value_or = [&](const char* parameter, double otherwise) {
    return delta.has(parameter) ? delta.number(parameter) : otherwise;
  };
  tip_length =
      tip_shape == DeltaTipShape::kSphere ? 2.0 * tip_radius : value_or("tip.length", 4.0 * tip_radius);
  joint_radius = value_or("arms.radius", workspace_radius);
  arm_length = value_or("arms.length", 2.0 * (workspace_radius + joint_radius));
  stiffness = value_or("stiffness", kUnlimited);
  damping = is_rigid() ? 0.0 : value_or("damping", kDampingTime_s * stiffness);
  max_force = value_or("max_force", is_rigid() ? kUnlimited : stiffness * workspace_radius);
}

bool Delta::is_rigid() const { return stiffness == kUnlimited; }
bool Delta::has_force_limit() const { return max_force != kUnlimited; }
double Delta::max_deflection() const { return is_rigid() ? 0.0 : max_force / stiffness; }

std::array<double, 3> Delta::joint_positions(const Eigen::Vector3d& tip) const {
  const double arm_squared = arm_length * arm_length;
  const double rest = std::sqrt(arm_squared - joint_radius * joint_radius);
  std::array<double, 3> positions;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector2d joint =
        joint_radius * Eigen::Vector2d(std::cos(kJointDirections[i]), std::sin(kJointDirections[i]));
    positions[i] = tip.z() + rest - std::sqrt(arm_squared - (tip.head<2>() - joint).squaredNorm());
  }
  return positions;
}

}  // namespace smartsurf::scene
