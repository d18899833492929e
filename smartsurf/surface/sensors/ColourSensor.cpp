#include "smartsurf/surface/sensors/ColourSensor.h"

#include "common/threads/ThreadPool.h"

namespace smartsurf::surface {

ColourSensor::ColourSensor(const Field& field, const scene::SensorSpec& spec)
    : ray_caster_(field, cell_ray_of(spec)),
      rows_(field.rows),
      cells_(static_cast<std::size_t>(field.cells())),
      planes_(3 * cells_, 0.0F) {}

void ColourSensor::sense(const SensorInput& input, common::ThreadPool& pool) {
  ray_caster_.cast(input.bodies, snapshot_index_tags(input.bodies, tags_), kPinTag, input.snapshot.height,
                   pool);
  pool.parallel_for_rows(rows_, ray_caster_.cost_ns(input.bodies.size()), [this, &input](int begin, int end) {
    ray_caster_.for_each_changed_span(
        begin, end, [this, &input](int first, int last) { write_colours(input, first, last); });
  });
}

void ColourSensor::write_colours(const SensorInput& input, int first, int last) noexcept {
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
    const float tag = ray_caster_.tag()[i];
    scene::Colour colour{0.0F, 0.0F, 0.0F};
    if (tag == kPinTag) colour = kPinColour;
    if (tag > 0.0F) colour = input.catalogue[input.snapshot.id[static_cast<std::size_t>(tag) - 1]].colour;
    planes_[i] = colour.r;
    planes_[cells_ + i] = colour.g;
    planes_[2 * cells_ + i] = colour.b;
  }
}

}  // namespace smartsurf::surface
