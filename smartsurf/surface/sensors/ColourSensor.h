// The colour of the closest hit of each cell's ray.
#pragma once

#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Colour of pins: light grey.
inline constexpr scene::Colour kPinColour{0.7F, 0.7F, 0.7F};
// Tag of a ray that hits a pin; a hit object's is 1 + its index in the snapshot, a miss has 0.
inline constexpr float kPinTag = -1.0F;

inline scene::Colour colour_of_tag(float tag, const SensorInput& input) {
  if (tag == kPinTag) return kPinColour;
  if (tag <= 0.0F) return {0.0F, 0.0F, 0.0F};
  return input.catalogue[input.snapshot.id[static_cast<std::size_t>(tag) - 1]].colour;
}

// Writes the colours of the cells [first, last) to three planes of `plane` cells each: red, green and blue.
inline void write_colours(const RayCaster& caster, const SensorInput& input, int first, int last, float* red,
                          std::size_t plane) noexcept {
  for (int i = first; i < last; ++i) {
    const scene::Colour colour = colour_of_tag(caster.tag()[i], input);
    red[i] = colour.r;
    red[plane + i] = colour.g;
    red[2 * plane + i] = colour.b;
  }
}

class ColourSensor final : public Sensor {
 public:
  ColourSensor(const Field& field, const scene::SensorSpec& spec)
      : ray_caster_(field, cell_ray_of(spec)),
        rows_(field.rows),
        cells_(field.cells()),
        planes_(3 * cells_, 0.0F) {}

  void sense(const SensorInput& input, common::ThreadPool& pool) override {
    ray_caster_.cast(input.bodies, snapshot_index_tags(input.bodies, tags_), kPinTag, input.snapshot.height,
                     pool);
    pool.parallel_for_rows(
        rows_, ray_caster_.cost_ns(input.bodies.size()), [this, &input](int begin, int end) {
          ray_caster_.for_each_changed_span(begin, end, [this, &input](int first, int last) {
            write_colours(ray_caster_, input, first, last, planes_.data(), cells_);
          });
        });
  }

  // Red, green and blue (sRGB) in [0, 1], one plane each; black without a hit.
  std::span<const float> values(int /*channel*/) const noexcept override { return planes_; }

 private:
  RayCaster ray_caster_;
  int rows_;
  std::size_t cells_;
  std::vector<float> planes_;
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
