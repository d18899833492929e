#include "smartsurf/surface/sensors/LightSensor.h"

#include <cmath>
#include <numbers>

#include "common/threads/ThreadPool.h"

namespace smartsurf::surface {
namespace {

// Direction to the k-th of `count` points spread evenly over the light's disc of angular radius size_rad, in
// a sunflower (Fermat spiral) pattern. Precondition: |centre| = 1.
Eigen::Vector3f light_sample_direction(const Eigen::Vector3d& centre, double size_rad, int k, int count) {
  const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * k;
  const double radius = std::tan(size_rad) * std::sqrt((k + 0.5) / count);
  const Eigen::Vector3d side = centre.unitOrthogonal(), across = centre.cross(side);
  return (centre + radius * (std::cos(angle) * side + std::sin(angle) * across)).normalized().cast<float>();
}

}  // namespace

LightSensor::LightSensor(const Field& field, const scene::SensorSpec& spec)
    : rows_(field.rows), visible_fraction_(static_cast<std::size_t>(field.cells()), 1.0F) {
  const double size_rad = spec.number("size");
  const int count = size_rad > 0.0 ? static_cast<int>(spec.number("samples")) : 1;
  CellRay ray = cell_ray_of(spec);
  for (int k = 0; k < count; ++k) {
    if (size_rad > 0.0)
      ray.direction = light_sample_direction(spec.vector("direction").normalized(), size_rad, k, count);
    ray_casters_.emplace_back(field, ray);
  }
}

void LightSensor::sense(const SensorInput& input, common::ThreadPool& pool) {
  if (body_tags_.size() < input.bodies.size()) body_tags_.resize(input.bodies.size(), 1.0F);
  const std::span<const float> body_tags(body_tags_.data(), input.bodies.size());
  for (RayCaster& caster : ray_casters_)
    caster.cast(input.bodies, body_tags, 1.0F, input.snapshot.height, pool);
  const double cost_ns =
      static_cast<double>(ray_casters_.size()) * ray_casters_.front().cost_ns(input.bodies.size());
  pool.parallel_for_rows(rows_, cost_ns, [this](int begin, int end) {
    const auto accumulate_occlusion = [this](int first, int last) {
      for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
        float blocked = 0.0F;
        for (const RayCaster& caster : ray_casters_) blocked += caster.tag()[i];
        visible_fraction_[i] = 1.0F - blocked / static_cast<float>(ray_casters_.size());
      }
    };
    for (const RayCaster& caster : ray_casters_)
      caster.for_each_changed_span(begin, end, accumulate_occlusion);
  });
}

}  // namespace smartsurf::surface
