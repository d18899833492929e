// The visible fraction of a distant light at each cell.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Direction to the k-th of `count` points spread evenly over the light's disc of angular radius size_rad, in
// a sunflower (Fermat spiral) pattern. Precondition: |centre| = 1.
inline Eigen::Vector3f light_sample_direction(const Eigen::Vector3d& centre, double size_rad, int k,
                                              int count) {
  const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * k;
  const double radius = std::tan(size_rad) * std::sqrt((k + 0.5) / count);
  const Eigen::Vector3d side = centre.unitOrthogonal(), across = centre.cross(side);
  return (centre + radius * (std::cos(angle) * side + std::sin(angle) * across)).normalized().cast<float>();
}

class LightSensor final : public Sensor {
 public:
  LightSensor(const Field& field, const scene::SensorSpec& spec)
      : rows_(field.rows), visible_fraction_(field.cells(), 1.0F) {
    const double size_rad = spec.number("size");
    const int count = size_rad > 0.0 ? static_cast<int>(spec.number("samples")) : 1;
    CellRay ray = cell_ray_of(spec);
    for (int k = 0; k < count; ++k) {
      if (size_rad > 0.0)
        ray.direction = light_sample_direction(spec.vector("direction").normalized(), size_rad, k, count);
      ray_casters_.emplace_back(field, ray);
    }
  }

  void sense(const SensorInput& input, common::ThreadPool& pool) override {
    if (body_tags_.size() < input.bodies.size()) body_tags_.resize(input.bodies.size(), 1.0F);
    const std::span<const float> body_tags(body_tags_.data(), input.bodies.size());
    for (RayCaster& caster : ray_casters_)
      caster.cast(input.bodies, body_tags, 1.0F, input.snapshot.height, pool);
    const double cost_ns =
        static_cast<double>(ray_casters_.size()) * ray_casters_.front().cost_ns(input.bodies.size());
    pool.parallel_for_rows(rows_, cost_ns, [this](int begin, int end) {
      const auto accumulate_occlusion = [this](int first, int last) {
        for (int i = first; i < last; ++i) {
          float blocked = 0.0F;
          for (const RayCaster& caster : ray_casters_) blocked += caster.tag()[i];
          visible_fraction_[i] = 1.0F - blocked / static_cast<float>(ray_casters_.size());
        }
      };
      for (const RayCaster& caster : ray_casters_)
        caster.for_each_changed_span(begin, end, accumulate_occlusion);
    });
  }

  // Fraction of the light's disc visible from the cell: 1 unobstructed, 0 in full shadow.
  std::span<const float> values(int /*channel*/) const noexcept override { return visible_fraction_; }

 private:
  int rows_;
  std::vector<RayCaster> ray_casters_;  // one per sample point of the light
  std::vector<float> visible_fraction_;
  std::vector<float> body_tags_;  // 1 for every body
};

}  // namespace smartsurf::surface
