#include "smartsurf/surface/Light.h"

#include <cmath>
#include <numbers>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

// The k-th of `count` points that lie evenly on the face of a light: a sunflower's seeds.
Eigen::Vector3f towards(const Eigen::Vector3d& centre, double size_rad, int k, int count) {
  const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0)) * k;
  const double radius = std::tan(size_rad) * std::sqrt((k + 0.5) / count);
  const Eigen::Vector3d side = centre.unitOrthogonal(), across = centre.cross(side);
  return (centre + radius * (std::cos(turn) * side + std::sin(turn) * across)).normalized().cast<float>();
}

}  // namespace

Light::Light(const Field& field, const scene::SensorSpec& spec)
    : rows_(field.rows), share_(static_cast<std::size_t>(field.cells()), 1.0F) {
  const double size_rad = spec.number("size");
  const int count = size_rad > 0.0 ? static_cast<int>(spec.number("samples")) : 1;
  Segment segment = segment_of(spec);
  for (int k = 0; k < count; ++k) {
    if (size_rad > 0.0)
      segment.direction = towards(spec.vector("direction").normalized(), size_rad, k, count);
    rays_.emplace_back(field, segment);
  }
}

void Light::sense(const Moment& moment, WorkerPool& pool) {
  if (shade_.size() < moment.bodies.size()) shade_.resize(moment.bodies.size(), 1.0F);
  const std::span<const float> shade(shade_.data(), moment.bodies.size());
  for (FirstHit& ray : rays_) ray.sweep(moment.bodies, shade, 1.0F, moment.snapshot.height, pool);
  const double cost_ns = static_cast<double>(rays_.size()) * rays_.front().cost_ns(moment.bodies.size());
  pool.for_rows(rows_, cost_ns, [this](int begin, int end) {
    const auto add_up = [this](int first, int last) {
      for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
        float blocked = 0.0F;
        for (const FirstHit& ray : rays_) blocked += ray.mark()[i];
        share_[i] = 1.0F - blocked / static_cast<float>(rays_.size());
      }
    };
    for (const FirstHit& ray : rays_) ray.for_changed(begin, end, add_up);
  });
}

}  // namespace smartsurf::surface
