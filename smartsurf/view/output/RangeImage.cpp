#include "smartsurf/view/output/RangeImage.h"

#include <limits>
#include <string>

#include "smartsurf/view/interaction/Picking.h"

namespace smartsurf::view {

RangeImage capture_range(const scene::SurfaceSpec& surface, const FrameInput& input, const Camera& camera,
                         int width, int height) {
  constexpr int kMaxPixels = 8192;
  if (width < 1 || height < 1 || width > kMaxPixels || height > kMaxPixels)
    throw scene::InputError("picture of " + std::to_string(width) + " x " + std::to_string(height) +
                            " pixels: must be 1 to 8192 each");
  const auto count = width * height;
  RangeImage out{std::vector<float>(count, std::numeric_limits<float>::infinity()),
                 std::vector<std::int32_t>(count, -1)};
  const Camera::PixelRays rays = camera.rays(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Ray ray = rays.at(x + 0.5, y + 0.5);
      const auto hit = pick(ray, surface, input);
      if (!hit) continue;
      const auto i = y * width + x;
      out.depth[i] = static_cast<float>(hit->distance * ray.direction.dot(rays.forward));
      out.segmentation[i] = hit->item.kind == SceneItem::Kind::kObject
                                ? static_cast<std::int32_t>(hit->item.object)
                                : -2 - surface.index(hit->item.row, hit->item.column);
    }
  return out;
}

}  // namespace smartsurf::view
