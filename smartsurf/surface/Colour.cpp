#include "smartsurf/surface/Colour.h"

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

constexpr float kPin = -1.0F;

}  // namespace

Colour::Colour(const Field& field, const scene::SensorSpec& spec)
    : first_(field, segment_of(spec)),
      rows_(field.rows),
      cells_(static_cast<std::size_t>(field.cells())),
      planes_(3 * cells_, 0.0F) {}

void Colour::sense(const Moment& moment, WorkerPool& pool) {
  first_.sweep(moment.bodies, numbered(moment.bodies, marks_), kPin, moment.snapshot.height, pool);
  pool.for_rows(rows_, first_.cost_ns(moment.bodies.size()), [this, &moment](int begin, int end) {
    first_.for_changed(begin, end, [this, &moment](int first, int last) { paint(moment, first, last); });
  });
}

void Colour::paint(const Moment& moment, int first, int last) noexcept {
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
    const float mark = first_.mark()[i];
    scene::Colour seen{0.0F, 0.0F, 0.0F};
    if (mark == kPin) seen = kPinColour;
    if (mark > 0.0F) seen = moment.catalogue[moment.snapshot.id[static_cast<std::size_t>(mark) - 1]].colour;
    planes_[i] = seen.r;
    planes_[cells_ + i] = seen.g;
    planes_[2 * cells_ + i] = seen.b;
  }
}

}  // namespace smartsurf::surface
