#include "smartsurf/surface/sensors/CameraSensor.h"

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/ColourSensor.h"

namespace smartsurf::surface {

CameraSensor::CameraSensor(const Field& field, const scene::SensorSpec& spec)
    : rows_(field.rows),
      cells_(static_cast<std::size_t>(field.cells())),
      camera_height_(static_cast<float>(spec.number("height"))),
      floor_height_(static_cast<float>(spec.number("floor"))) {
  const int n = static_cast<int>(spec.number("resolution"));
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column) {
      const float west = ((static_cast<float>(column) + 0.5F) / static_cast<float>(n) - 0.5F) * field.pitch;
      const float north = (0.5F - (static_cast<float>(row) + 0.5F) / static_cast<float>(n)) * field.pitch;
      ray_casters_.emplace_back(field, CellRay{.origin = {west, north, camera_height_},
                                               .direction = {0.0F, 0.0F, -1.0F},
                                               .range = camera_height_ - floor_height_,
                                               .from_top = false});
    }
  colour_.assign(3 * ray_casters_.size() * cells_, 0.0F);
  height_.assign(ray_casters_.size() * cells_, floor_height_);
}

void CameraSensor::sense(const SensorInput& input, common::ThreadPool& pool) {
  const std::span<const float> tags = snapshot_index_tags(input.bodies, tags_);
  for (std::size_t pixel = 0; pixel < ray_casters_.size(); ++pixel) {
    ray_casters_[pixel].cast(input.bodies, tags, kPinTag, input.snapshot.height, pool);
    pool.parallel_for_rows(rows_, ray_casters_[pixel].cost_ns(input.bodies.size()), [&](int begin, int end) {
      ray_casters_[pixel].for_each_changed_span(
          begin, end, [&](int first, int last) { write_pixels(input, pixel, first, last); });
    });
  }
}

void CameraSensor::write_pixels(const SensorInput& input, std::size_t pixel, int first, int last) noexcept {
  const RayCaster& caster = ray_casters_[pixel];
  float* const red = colour_.data() + 3 * pixel * cells_;
  float* const height = height_.data() + pixel * cells_;
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
    const float tag = caster.tag()[i];
    scene::Colour colour{0.0F, 0.0F, 0.0F};
    if (tag == kPinTag) colour = kPinColour;
    if (tag > 0.0F) colour = input.catalogue[input.snapshot.id[static_cast<std::size_t>(tag) - 1]].colour;
    red[i] = colour.r;
    red[cells_ + i] = colour.g;
    red[2 * cells_ + i] = colour.b;
    height[i] = tag == 0.0F ? floor_height_ : camera_height_ - caster.distance()[i];
  }
}

}  // namespace smartsurf::surface
