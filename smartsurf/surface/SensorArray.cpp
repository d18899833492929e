#include "smartsurf/surface/SensorArray.h"

#include <algorithm>

namespace smartsurf::surface {
namespace {

SensedBodies bodies_over(const Field& field) {
  if (field.rectangular()) return {0.0F, static_cast<float>(field.rows - 1) * field.pitch};
  return {*std::ranges::min_element(field.y), *std::ranges::max_element(field.y)};
}

}  // namespace

SensorArray::SensorArray(const scene::SceneSpec& scene, const Field& field, const FaultMap& map)
    : period_s_(scene.world.control_period_s), bodies_(bodies_over(field)) {
  const scene::SurfaceSpec& surface = scene.surface;
  for (const scene::SensorSpec& spec : surface.sensors) {
    Fitted fitted{make_sensor(field, spec), Imperfections(spec, scene, map), {}};
    int n = 0;
    for (scene::SensorChannel& channel : scene::find_sensor_kind(spec.model)->channels(spec)) {
      fitted.truth.push_back(fitted.sensor->values(n));
      places_.push_back({fitted_.size(), n++});
      channels_.push_back(std::move(channel));
    }
    if (fitted.sensor->feels()) impulse_.assign(static_cast<std::size_t>(surface.cells()), 0.0F);
    fitted_.push_back(std::move(fitted));
  }
}

SensorArray::~SensorArray() = default;

void SensorArray::feel(std::span<const float> impulse) noexcept {
  const std::size_t cells = std::min(impulse_.size(), impulse.size());
  for (std::size_t i = 0; i < cells; ++i) impulse_[i] += impulse[i];
}

void SensorArray::sense(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                        WorkerPool& pool) {
  if (fitted_.empty()) return;
  bodies_.update(snapshot, catalogue, pool);
  const Moment moment{snapshot, catalogue, bodies_, impulse_, period_s_};
  for (Fitted& f : fitted_) {
    f.sensor->sense(moment, pool);
    if (f.imperfections.any()) f.imperfections.apply(ticks_, f.truth, pool);
  }
  std::ranges::fill(impulse_, 0.0F);
  ++ticks_;
}

std::span<const float> SensorArray::truth(int channel) const noexcept {
  const Place& place = places_[static_cast<std::size_t>(channel)];
  return fitted_[place.sensor].truth[static_cast<std::size_t>(place.channel)];
}

std::span<const float> SensorArray::readings(int channel) const noexcept {
  const Place& place = places_[static_cast<std::size_t>(channel)];
  const Fitted& f = fitted_[place.sensor];
  return f.imperfections.any() ? f.imperfections.values(place.channel) : truth(channel);
}

}  // namespace smartsurf::surface
