// Sensors of an extension. Internal to this module.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "smartsurf/extension/PluginTables.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::extension {

class PluginSensor final : public surface::Sensor {
 public:
  // `type` must outlive the process; `parameters` are its own. Throws common::UserError if it creates no
  // instance.
  PluginSensor(const smartsurf_plugin_sensor& type, std::span<const scene::Parameter> parameters,
               std::vector<scene::SensorChannel> channels, const surface::Field&, const scene::SensorSpec&);
  ~PluginSensor() override { type_.destroy(instance_); }

  // Throws common::UserError if the extension casts a ray that it has not prepared.
  void sense(const surface::SensorInput&, common::ThreadPool&) override;
  std::span<const float> values(int channel) const noexcept override { return readings_[channel]; }
  void archive(common::StateArchive&) override;
  bool needs_impulses() const noexcept override { return (type_.flags & SMARTSURF_NEEDS_IMPULSES) != 0; }

 private:
  struct Ray {
    surface::RayCaster caster;
    std::vector<std::int32_t> object;  // rows × columns
  };
  // The interface's structs, from which its callbacks find the sensor.
  struct Context : smartsurf_plugin_sensor_context {
    PluginSensor* sensor;
    const surface::Field* field;
  };
  struct Scene : smartsurf_plugin_scene {
    PluginSensor* sensor;
    const surface::SensorInput* input;
    common::ThreadPool* pool;
  };
  static std::uint32_t add_ray(const smartsurf_plugin_sensor_context*, const smartsurf_plugin_ray*);
  static void cast(const smartsurf_plugin_scene*, std::uint32_t ray, const float** distance,
                   const std::int32_t** object);

  const smartsurf_plugin_sensor& type_;
  std::string subject_;  // as which messages name it
  std::vector<scene::SensorChannel> channels_;
  PluginSurface surface_;
  std::vector<smartsurf_plugin_value> values_;
  std::vector<std::vector<float>> readings_;  // by channel
  std::vector<float*> reading_pointers_;      // to them
  std::deque<Ray> rays_;
  std::string ray_problem_;                   // of the first one that create() has prepared in vain
  std::optional<std::uint32_t> unknown_ray_;  // that sense() has cast
  std::vector<float> no_distance_;            // what it gets: 0
  std::vector<std::int32_t> no_object_;       // and -1
  std::vector<float> tags_;
  ObjectTable objects_;
  void* instance_;
};

}  // namespace smartsurf::extension
