#include "smartsurf/record/hdf5/Hdf5Meta.h"

#include <cstring>

#include "smartsurf/record/hdf5/SurfaceLayout.h"

namespace smartsurf::record {

void write_meta(hid_t file, const RunMetadata& meta, const scene::SceneSpec& spec) {
  const Handle group = create_group(file, "meta");
  write_attribute(group, "format", std::string("smartsurf-recording"));
  write_attribute(group, "format_version", std::uint64_t{1});
  write_attribute(group, "version", std::string(SMARTSURF_VERSION));
  write_attribute(group, "command_line", meta.command_line);
  write_attribute(group, "mode", meta.mode);
  write_attribute(group, "experiment_file", spec.file);
  write_attribute(group, "experiment", spec.source);
  write_attribute(group, "program_file", meta.program_file);
  write_attribute(group, "program", meta.program_text);
  write_attribute(group, "driver", meta.driver);
  write_attribute(group, "unsafe", std::uint64_t{meta.unsafe});
  if (meta.declares_success)
    write_attribute(group, "declares_success", std::uint64_t{*meta.declares_success});
  write_attribute(group, "engine", spec.world.engine);
  write_attribute(group, "seed", spec.world.seed);
  write_attribute(group, "dt_s", spec.world.dt_s);
  write_attribute(group, "control_period_s", spec.world.control_period_s);
  write_attribute(group, "iterations", static_cast<std::uint64_t>(spec.world.iterations));
  if (spec.world.unit) write_attribute(group, "unit", std::string(spec.world.unit->name));
  write_attribute(group, "gravity", H5T_NATIVE_DOUBLE, spec.world.gravity.data(), 3);
  write_attribute(group, "ground", std::uint64_t{spec.world.ground});
  write_attribute(group, "sleep", std::uint64_t{spec.world.sleep});
  write_attribute(group, "every", static_cast<std::uint64_t>(spec.record.tick_interval));
  const Handle options = create_group(group, "options");
  for (const scene::OptionSpec& option : spec.options)
    write_attribute(options, option.name.c_str(), option.value);
  const Handle set = create_group(group, "set");
  for (const NamedText& setting : meta.overrides) {
    if (has_attribute(set, setting.name.c_str())) H5Adelete(set, setting.name.c_str());  // the last one wins
    write_attribute(set, setting.name.c_str(), setting.value);
  }
  const Handle versions = create_group(group, "versions");
  write_attribute(versions, "smartsurf", std::string(SMARTSURF_VERSION));
  write_attribute(versions, "hdf5", std::string(H5_VERS_INFO).substr(std::strlen("HDF5 library version: ")));
  for (const NamedText& version : meta.versions)
    if (!has_attribute(versions, version.name.c_str()))
      write_attribute(versions, version.name.c_str(), version.value);
}

namespace {

// The models, separated by commas: "pin, wheels".
std::string actuator_names(const scene::SurfaceSpec& surface) {
  std::string names;
  for (const scene::ActuatorSpec& actuator : surface.effective_actuators())
    names += (names.empty() ? "" : ", ") + actuator.model;
  return names;
}

}  // namespace

Handle write_surface(hid_t file, const scene::SurfaceSpec& surface) {
  Handle group = create_group(file, "surface");
  const scene::PinSpec& pin = surface.pin;
  const double top[] = {pin.top_x, pin.top_y}, range[] = {pin.min_height, pin.max_height};
  write_attribute(group, "rows", static_cast<std::uint64_t>(surface.rows));
  write_attribute(group, "columns", static_cast<std::uint64_t>(surface.columns));
  write_attribute(group, "pitch", surface.pitch);
  write_attribute(group, "actuator", actuator_names(surface));
  write_attribute(group, "top", H5T_NATIVE_DOUBLE, top, 2);
  write_attribute(group, "length", pin.length);
  write_attribute(group, "range", H5T_NATIVE_DOUBLE, range, 2);
  write_attribute(group, "max_speed", pin.max_speed);
  write_attribute(group, "max_acceleration", pin.max_acceleration);
  if (surface.border_height) write_attribute(group, "border", *surface.border_height);
  write_layout(group, surface);
  return group;
}

}  // namespace smartsurf::record
