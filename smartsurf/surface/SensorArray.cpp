#include "smartsurf/surface/SensorArray.h"

#include <algorithm>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/sensors/SensorRegistry.h"

namespace smartsurf::surface {
namespace {

RayBodies make_ray_bodies(const Field& field) {
  if (field.is_rectangular()) return {0.0F, static_cast<float>(field.rows - 1) * field.pitch};
  return {*std::ranges::min_element(field.y), *std::ranges::max_element(field.y)};
}

}  // namespace

SensorArray::SensorArray(const scene::SceneSpec& scene, const Field& field, const FaultMap& map)
    : period_s_(scene.world.control_period_s), bodies_(make_ray_bodies(field)) {
  const scene::SurfaceSpec& surface = scene.surface;
  for (const scene::SensorSpec& spec : surface.sensors) {
    SensorInstance instance{make_sensor(field, spec), SensorErrorModel(spec, scene, map), {}};
    int channel_index = 0;
    for (scene::SensorChannel& channel : scene::find_sensor_kind(spec.model)->channels(spec)) {
      instance.truth.push_back(instance.sensor->values(channel_index));
      channel_refs_.push_back({sensors_.size(), channel_index++});
      channels_.push_back(std::move(channel));
    }
    if (instance.sensor->needs_impulses()) {
      impulse_.assign(surface.cell_count(), 0.0F);
      tip_impulse_.assign(field.tip_impulse.size(), Eigen::Vector3f::Zero());
      skin_impulse_.assign(field.skin.nodes(), 0.0F);
    }
    sensors_.push_back(std::move(instance));
  }
}

SensorArray::~SensorArray() = default;

void SensorArray::accumulate_impulses(std::span<const float> cells, std::span<const Eigen::Vector3f> tips,
                                      std::span<const float> skin) noexcept {
  const auto add = [](auto& sums, auto impulse) {
    for (std::size_t i = 0; i < std::min(sums.size(), impulse.size()); ++i) sums[i] += impulse[i];
  };
  add(impulse_, cells);
  add(tip_impulse_, tips);
  add(skin_impulse_, skin);
}

void SensorArray::clear_impulses() noexcept {
  std::ranges::fill(impulse_, 0.0F);
  std::ranges::fill(tip_impulse_, Eigen::Vector3f::Zero());
  std::ranges::fill(skin_impulse_, 0.0F);
}

void SensorArray::sense(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                        common::ThreadPool& pool) {
  if (sensors_.empty()) return;
  bodies_.update(snapshot, catalogue, pool);
  const SensorInput input{snapshot, catalogue, bodies_, impulse_, tip_impulse_, skin_impulse_, period_s_};
  for (SensorInstance& f : sensors_) {
    f.sensor->sense(input, pool);
    if (f.error_model.is_active()) f.error_model.apply(tick_, f.truth, pool);
  }
  clear_impulses();
  ++tick_;
}

void SensorArray::archive(common::StateArchive& a, const scene::Snapshot& snapshot,
                          std::span<const scene::ObjectSpec> catalogue, common::ThreadPool& pool) {
  a(tick_);
  if (!a.saves() && !sensors_.empty()) {
    clear_impulses();
    bodies_.forget_objects();
    bodies_.update(snapshot, catalogue, pool);
  }
  const SensorInput input{snapshot,     catalogue,     bodies_,   impulse_,
                          tip_impulse_, skin_impulse_, period_s_, /*restored=*/!a.saves()};
  for (SensorInstance& f : sensors_) {
    if (!a.saves()) f.sensor->sense(input, pool);
    f.sensor->archive(a);
    if (f.error_model.is_active()) f.error_model.archive(a);
  }
}

std::span<const float> SensorArray::truth(int channel) const noexcept {
  const ChannelRef& ref = channel_refs_[channel];
  return sensors_[ref.sensor].truth[ref.channel];
}

std::span<const float> SensorArray::readings(int channel) const noexcept {
  const ChannelRef& ref = channel_refs_[channel];
  const SensorInstance& f = sensors_[ref.sensor];
  return f.error_model.is_active() ? f.error_model.values(ref.channel) : truth(channel);
}

}  // namespace smartsurf::surface
