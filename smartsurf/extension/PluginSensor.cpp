#include "smartsurf/extension/PluginSensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::extension {
namespace {

// The fault of a ray, one clause; "" if it can be cast.
std::string problem_of(const surface::CellRay& ray, const Eigen::Vector3f& direction) {
  const auto text = [](const Eigen::Vector3f& v) { return fmt::format("({}, {}, {})", v.x(), v.y(), v.z()); };
  if (!ray.origin.allFinite()) return "origin = " + text(ray.origin) + ": must be finite";
  if (!direction.allFinite() || direction == Eigen::Vector3f::Zero())
    return "direction = " + text(direction) + ": must be finite and not 0";
  if (!(ray.range >= 0.0F && std::isfinite(ray.range)))
    return fmt::format("range = {}: must be finite and not negative", ray.range);
  return "";
}

}  // namespace

PluginSensor::PluginSensor(const smartsurf_plugin_sensor& type, std::span<const scene::Parameter> parameters,
                           std::vector<scene::SensorChannel> channels, const surface::Field& field,
                           const scene::SensorSpec& spec)
    : type_(type),
      subject_(fmt::format("{}: sensor '{}'", scene::find_sensor_kind(type.name)->extension.name, spec.name)),
      channels_(std::move(channels)),
      surface_(field),
      values_(values_of(parameters, spec.values)) {
  for (const scene::SensorChannel& channel : channels_)
    readings_.emplace_back(channel.components * field.height.size(),
                           static_cast<float>(channel.no_detection));
  for (std::vector<float>& readings : readings_) reading_pointers_.push_back(readings.data());
  Message message{};
  Context context{{.size = sizeof(smartsurf_plugin_sensor_context),
                   .surface = surface_.get(),
                   .values = values_.data(),
                   .add_ray = add_ray,
                   .message = message.data()},
                  this,
                  &field};
  instance_ = type.create(&context);
  require_created(instance_, type.name, message);
  if (!ray_problem_.empty()) {  // the callback cannot throw through the extension
    type.destroy(instance_);
    throw common::UserError(subject_ + ": " + ray_problem_);
  }
}

std::uint32_t PluginSensor::add_ray(const smartsurf_plugin_sensor_context* plugin_context,
                                    const smartsurf_plugin_ray* ray) {
  const Context& context = static_cast<const Context&>(*plugin_context);
  // Squares of float lengths are doubles without overflow and underflow.
  const Eigen::Vector3f direction(ray->direction);
  surface::CellRay cell_ray{.origin = Eigen::Vector3f(ray->origin),
                            .direction = direction.cast<double>().normalized().cast<float>(),
                            .range = ray->range,
                            .hits_pins = ray->hits_pins != 0};
  PluginSensor& sensor = *context.sensor;
  if (const std::string problem = problem_of(cell_ray, direction); !problem.empty()) {
    if (sensor.ray_problem_.empty())
      sensor.ray_problem_ = fmt::format("ray {}: {}", sensor.rays_.size(), problem);
    cell_ray = {.origin = Eigen::Vector3f::Zero(), .direction = Eigen::Vector3f::UnitZ(), .range = 0.0F};
  }
  std::deque<Ray>& rays = sensor.rays_;
  rays.push_back({{*context.field, cell_ray}, std::vector<std::int32_t>(context.field->height.size())});
  return static_cast<std::uint32_t>(rays.size() - 1);
}

void PluginSensor::cast(const smartsurf_plugin_scene* plugin_scene, std::uint32_t index,
                        const float** distance, const std::int32_t** object) {
  const Scene& scene = static_cast<const Scene&>(*plugin_scene);
  const surface::SensorInput& input = *scene.input;
  PluginSensor& sensor = *scene.sensor;
  if (index >= sensor.rays_.size()) {  // sense() throws once the extension has returned
    sensor.unknown_ray_ = index;
    sensor.no_distance_.assign(sensor.readings_.front().size(), 0.0F);
    sensor.no_object_.assign(sensor.no_distance_.size(), -1);
    *distance = sensor.no_distance_.data();
    *object = sensor.no_object_.data();
    return;
  }
  Ray& ray = sensor.rays_[index];
  ray.caster.cast(input.bodies, surface::snapshot_index_tags(input.bodies, sensor.tags_), 0.0F,
                  input.snapshot.height, *scene.pool);
  std::ranges::transform(ray.caster.tag(), ray.object.begin(),
                         [](float tag) { return static_cast<std::int32_t>(tag) - 1; });
  *distance = ray.caster.distance().data();
  *object = ray.object.data();
}

void PluginSensor::sense(const surface::SensorInput& input, common::ThreadPool& pool) {
  const scene::Snapshot& snapshot = input.snapshot;
  const auto flat = [](const auto& rows) { return rows.empty() ? nullptr : rows.front().data(); };
  smartsurf_plugin_objects objects{};
  objects.size = sizeof objects;
  objects.count = static_cast<std::uint32_t>(snapshot.object_count());
  objects.id = snapshot.id.data();
  objects.position = flat(snapshot.position);
  objects.orientation = flat(snapshot.orientation);
  objects.velocity = flat(snapshot.velocity);
  objects.angular_velocity = flat(snapshot.angular_velocity);
  if (input.restored) objects_.invalidate();
  objects_.describe(input.catalogue, objects);
  const Scene scene{{.size = sizeof(smartsurf_plugin_scene),
                     .tick = snapshot.tick,
                     .time_s = snapshot.time_s,
                     .period_s = input.period_s,
                     .objects = &objects,
                     .height = snapshot.height.data(),
                     .impulse = needs_impulses() ? input.impulse.data() : nullptr,
                     .cast = cast},
                    this,
                    &input,
                    &pool};
  type_.sense(instance_, &scene, reading_pointers_.data());
  if (unknown_ray_)
    throw common::UserError(
        fmt::format("{}: casts ray {}, but has prepared {}", type_.name, *unknown_ray_, rays_.size()));
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const auto low = static_cast<float>(channels_[c].minimum),
               high = static_cast<float>(channels_[c].maximum);
    const auto none = static_cast<float>(channels_[c].no_detection);
    for (float& reading : readings_[c]) reading = std::isnan(reading) ? none : std::clamp(reading, low, high);
  }
}

void PluginSensor::archive(common::StateArchive& a) {
  if (needs_impulses()) a(readings_);  // a restored world senses without the impulses
  if (type_.save != nullptr && type_.restore != nullptr)
    archive_instance(a, subject_, instance_, type_.save, type_.restore);
}

}  // namespace smartsurf::extension
