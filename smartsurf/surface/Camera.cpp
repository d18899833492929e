#include "smartsurf/surface/Camera.h"

#include "smartsurf/surface/Colour.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

constexpr float kPin = -1.0F;

}  // namespace

Camera::Camera(const Field& field, const scene::SensorSpec& spec)
    : rows_(field.rows),
      cells_(static_cast<std::size_t>(field.cells())),
      above_(static_cast<float>(spec.number("height"))),
      floor_(static_cast<float>(spec.number("floor"))) {
  const int n = static_cast<int>(spec.number("resolution"));
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column) {
      const float west = ((static_cast<float>(column) + 0.5F) / static_cast<float>(n) - 0.5F) * field.pitch;
      const float north = (0.5F - (static_cast<float>(row) + 0.5F) / static_cast<float>(n)) * field.pitch;
      rays_.emplace_back(field, Segment{.origin = {west, north, above_},
                                        .direction = {0.0F, 0.0F, -1.0F},
                                        .range = above_ - floor_,
                                        .from_top = false});
    }
  colour_.assign(3 * rays_.size() * cells_, 0.0F);
  height_.assign(rays_.size() * cells_, floor_);
}

void Camera::sense(const Moment& moment, WorkerPool& pool) {
  const std::span<const float> marks = numbered(moment.bodies, marks_);
  for (std::size_t pixel = 0; pixel < rays_.size(); ++pixel) {
    rays_[pixel].sweep(moment.bodies, marks, kPin, moment.snapshot.height, pool);
    pool.for_rows(rows_, rays_[pixel].cost_ns(moment.bodies.size()), [&](int begin, int end) {
      rays_[pixel].for_changed(begin, end, [&](int first, int last) { paint(moment, pixel, first, last); });
    });
  }
}

void Camera::paint(const Moment& moment, std::size_t pixel, int first, int last) noexcept {
  const FirstHit& ray = rays_[pixel];
  float* const red = colour_.data() + 3 * pixel * cells_;
  float* const height = height_.data() + pixel * cells_;
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
    const float mark = ray.mark()[i];
    scene::Colour seen{0.0F, 0.0F, 0.0F};
    if (mark == kPin) seen = kPinColour;
    if (mark > 0.0F) seen = moment.catalogue[moment.snapshot.id[static_cast<std::size_t>(mark) - 1]].colour;
    red[i] = seen.r;
    red[cells_ + i] = seen.g;
    red[2 * cells_ + i] = seen.b;
    height[i] = mark == 0.0F ? floor_ : above_ - ray.distance()[i];
  }
}

}  // namespace smartsurf::surface
