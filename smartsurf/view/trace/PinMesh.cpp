#include "smartsurf/view/trace/PinMesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::view {

// Rings of 4 × (segments + 1) vertices from the top's edge over the rounded edge down to the foot.
PinMesh::PinMesh(float half_x, float half_y, int segments) {
  const float radius = 0.2F * std::min(half_x, half_y), quarter = 0.5F * std::numbers::pi_v<float>;
  const auto step = quarter / static_cast<float>(segments);
  const auto around = static_cast<std::uint32_t>(4 * (segments + 1)),
             rings = static_cast<std::uint32_t>(segments + 2);
  for (std::uint32_t ring = 0; ring < rings; ++ring) {
    const bool foot = ring + 1 == rings;
    const float down = foot ? quarter : step * static_cast<float>(ring);
    for (int corner = 0; corner < 4; ++corner)
      for (int i = 0; i <= segments; ++i) {
        const float turn = quarter * static_cast<float>(corner) + step * static_cast<float>(i);
        const Eigen::Vector3f normal(std::sin(down) * std::cos(turn), std::sin(down) * std::sin(turn),
                                     std::cos(down));
        const Eigen::Vector3f centre((corner == 0 || corner == 3 ? 1.0F : -1.0F) * (half_x - radius),
                                     (corner < 2 ? 1.0F : -1.0F) * (half_y - radius), -radius);
        vertices.push_back({centre + radius * normal, normal, foot});
      }
  }
  const auto corner = static_cast<std::uint32_t>(segments + 1);
  triangles = {{0, corner, 2 * corner}, {0, 2 * corner, 3 * corner}};
  for (std::uint32_t ring = 0; ring + 1 < rings; ++ring)
    for (std::uint32_t i = 0; i < around; ++i) {
      const std::uint32_t a = ring * around + i, b = ring * around + (i + 1) % around;
      triangles.push_back({a, a + around, b + around});
      triangles.push_back({a, b + around, b});
    }
}

}  // namespace smartsurf::view
