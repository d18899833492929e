// An orthographic image of the surface from above: colour and height of the topmost object or pin at each
// pixel.
#pragma once

#include <vector>

#include "smartsurf/surface/sensors/ColourSensor.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class CameraSensor final : public Sensor {
 public:
  CameraSensor(const Field& field, const scene::SensorSpec& spec)
      : rows_(field.rows),
        cells_(field.cells()),
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

  void sense(const SensorInput& input, common::ThreadPool& pool) override {
    const std::span<const float> tags = snapshot_index_tags(input.bodies, tags_);
    for (std::size_t pixel = 0; pixel < ray_casters_.size(); ++pixel) {
      ray_casters_[pixel].cast(input.bodies, tags, kPinTag, input.snapshot.height, pool);
      pool.parallel_for_rows(
          rows_, ray_casters_[pixel].cost_ns(input.bodies.size()), [&](int begin, int end) {
            ray_casters_[pixel].for_each_changed_span(
                begin, end, [&](int first, int last) { write_pixels(input, pixel, first, last); });
          });
    }
  }

  // A cell has n × n pixels in row-major order from its north-west corner. Channel 0: red, green and blue of
  // pixel p in [0, 1] as components 3p, 3p + 1 and 3p + 2. Channel 1: z of pixel p, u, as component p.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? colour_ : height_;
  }

 private:
  void write_pixels(const SensorInput& input, std::size_t pixel, int first, int last) noexcept {
    const RayCaster& caster = ray_casters_[pixel];
    write_colours(caster, input, first, last, colour_.data() + 3 * pixel * cells_, cells_);
    float* const height = height_.data() + pixel * cells_;
    for (int i = first; i < last; ++i)
      height[i] = caster.tag()[i] == 0.0F ? floor_height_ : camera_height_ - caster.distance()[i];
  }

  int rows_;
  std::size_t cells_;
  float camera_height_, floor_height_;
  std::vector<RayCaster> ray_casters_;  // one per pixel
  std::vector<float> colour_, height_;
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
