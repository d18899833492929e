#include "smartsurf/record/hdf5/Hdf5Meta.h"

#include <algorithm>
#include <cstring>

#include "common/text/Words.h"
#include "smartsurf/record/hdf5/AttributeArchive.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/record/hdf5/Names.h"
#include "smartsurf/record/hdf5/SurfaceLayout.h"

namespace smartsurf::record {
namespace {

const std::string kFormat = "smartsurf-recording";
constexpr int kFormatVersion = 1;

template <class Archive, class Meta, class Spec>
void archive_meta(const Archive& a, Meta& meta, Spec& spec) {
  a("command_line", meta.command_line);
  a("mode", meta.mode);
  a("experiment_file", spec.file);
  a("experiment", spec.source);
  a("program_file", meta.program_file);
  a("program", meta.program_text);
  a.since("driver", meta.driver);
  a.since("unsafe", meta.unsafe);
  a("declares_success", meta.declares_success);
  auto& world = spec.world;
  a("control_period_s", world.control_period_s);
  a.count("every", spec.record.tick_interval, 1u << 30);
  if (!meta.is_simulated) return;
  a.since("engine", world.engine);
  a("seed", world.seed);
  a("dt_s", world.dt_s);
  a.count("iterations", world.iterations, 1u << 20);
  std::optional<std::string> unit;
  if (world.unit) unit = world.unit->name;
  a("unit", unit);
  if constexpr (Archive::kReads)
    if (unit) world.unit = scene::find_physical_unit(*unit);
  std::array<double, 3> gravity{world.gravity.x(), world.gravity.y(), world.gravity.z()};
  a("gravity", gravity);
  if constexpr (Archive::kReads) world.gravity = {gravity[0], gravity[1], gravity[2]};
  a("ground", world.ground);
  a.since("sleep", world.sleep);
}

template <class Archive, class Result>
void archive_result(const Archive& a, Result& result) {
  a("outcome", result.outcome);
  a("ticks", result.ticks);
  a("simulated_s", result.simulated_s);
  a("state_hash", result.state_hash);
  a("success", result.success);
  a("success_s", result.success_s);
}

template <class Archive, class Surface>
void archive_surface(const Archive& a, Surface& surface) {
  a.count("rows", surface.rows, 1u << 14);
  a.count("columns", surface.columns, 1u << 14);
  a("pitch", surface.pitch);
  auto& pin = surface.pin;
  std::array<double, 2> top{pin.top_x, pin.top_y}, range{pin.min_height, pin.max_height};
  a("top", top);
  a("length", pin.length);
  a("range", range);
  a("max_speed", pin.max_speed);
  a("max_acceleration", pin.max_acceleration);
  a("border", surface.border_height);
  if constexpr (Archive::kReads) {
    pin.top_x = top[0], pin.top_y = top[1];
    pin.min_height = range[0], pin.max_height = range[1];
  }
}

constexpr const char* kActuator = "actuator";

// The models, separated by commas: "pin, wheels".
std::string actuator_names(const scene::SurfaceSpec& surface) {
  return common::join(surface.effective_actuators(), &scene::ActuatorSpec::model);
}

std::vector<scene::Variation> read_variations(hid_t meta) {
  std::vector<scene::Variation> all;
  const Handle drawn = open_group(meta, paths::kVaried);
  const AttributeReader read(drawn);
  for (const NamedText& range : read_string_attributes(meta, paths::kVary)) {
    all.push_back(scene::parse_variation(range.name, range.value, "meta/vary"));
    double number = 0.0;
    read(range.name.c_str(), number);
    all.back().drawn = number;
  }
  return all;
}

}  // namespace

void write_meta(hid_t file, const RunMetadata& meta, const scene::SceneSpec& spec) {
  const Handle group = create_group(file, paths::kMeta);
  const AttributeWriter write(group);
  write("format", kFormat);
  write.count("format_version", kFormatVersion, 0);
  write("version", std::string(SMARTSURF_VERSION));
  archive_meta(write, meta, spec);
  const Handle options = create_group(group, paths::kOptions);
  for (const scene::OptionSpec& option : spec.options)
    write_attribute(options, option.name.c_str(), option.value);
  if (!meta.varied.empty()) {
    const Handle ranges = create_group(group, paths::kVary), drawn = create_group(group, paths::kVaried);
    for (const scene::Variation& v : meta.varied) {
      write_attribute(ranges, v.name.c_str(), to_text(v));
      if (v.drawn) write_attribute(drawn, v.name.c_str(), *v.drawn);
    }
  }
  if (std::ranges::any_of(spec.materials, &scene::Material::look)) {
    const Handle looks = create_group(group, paths::kLooks);
    for (const scene::Material& material : spec.materials)
      write_attribute(looks, material.name.c_str(), std::string(scene::kLookNames.at(material.look)));
  }
  const Handle set = create_group(group, paths::kSet);
  for (const NamedText& setting : meta.overrides) {
    if (has_attribute(set, setting.name.c_str())) H5Adelete(set, setting.name.c_str());  // the last one wins
    write_attribute(set, setting.name.c_str(), setting.value);
  }
  if (!meta.extensions.empty()) {
    const Handle extensions = create_group(group, paths::kExtensions);
    for (const auto& [name, hash] : meta.extensions) write_attribute(extensions, name.c_str(), hash);
  }
  const Handle versions = create_group(group, paths::kVersions);
  write_attribute(versions, "smartsurf", std::string(SMARTSURF_VERSION));
  write_attribute(versions, "hdf5", std::string(H5_VERS_INFO).substr(std::strlen("HDF5 library version: ")));
  for (const NamedText& version : meta.versions)
    if (!has_attribute(versions, version.name.c_str()))
      write_attribute(versions, version.name.c_str(), version.value);
}

void write_result(hid_t file, const RunResult& result) {
  const Handle group = open_group(file, paths::kMeta);
  archive_result(AttributeWriter(group), result);
  if (result.metrics.empty()) return;
  const Handle metrics = create_group(group, paths::kMetrics);
  for (const auto& [name, value] : result.metrics) write_attribute(metrics, link_name(name).c_str(), value);
}

void write_surface(hid_t file, const scene::SurfaceSpec& surface) {
  const Handle group = create_group(file, paths::kSurface);
  archive_surface(AttributeWriter(group), surface);
  write_attribute(group, kActuator, actuator_names(surface));
  write_layout(group, surface);
}

RecordedMeta read_meta(hid_t file, scene::SceneSpec& spec) {
  const Handle group = open_group(file, paths::kMeta);
  const AttributeReader read(group);
  std::optional<std::string> format;
  read("format", format);
  if (format != kFormat) throw Hdf5Error("is an HDF5 file, but not a recording of smartsurf");
  int version = 0;
  read.count("format_version", version, 1u << 30);
  if (version != kFormatVersion)
    throw Hdf5Error("is a recording in format " + std::to_string(version) + "; this program reads format 1");
  RecordedMeta recorded;
  recorded.meta.is_simulated = has_attribute(group, "seed") && !has_link(file, paths::kClock);
  archive_meta(read, recorded.meta, spec);
  recorded.meta.versions = read_string_attributes(group, paths::kVersions);
  if (has_link(group, paths::kExtensions))
    recorded.meta.extensions = read_string_attributes(group, paths::kExtensions);
  if (has_link(group, paths::kSet)) recorded.meta.overrides = read_string_attributes(group, paths::kSet);
  read(paths::kTouchedByHand, recorded.first_interaction_tick);
  for (NamedText& option : read_string_attributes(group, paths::kOptions))
    spec.options.push_back({std::move(option.name), std::move(option.value), ""});
  if (has_link(group, paths::kVary)) recorded.meta.varied = read_variations(group);
  if (has_attribute(group, "simulated_s")) {
    archive_result(read, recorded.result.emplace());
    if (has_link(group, paths::kMetrics))
      recorded.result->metrics = read_number_attributes(group, paths::kMetrics);
    for (auto& [name, value] : recorded.result->metrics) name = name_of_link(name);
  }
  return recorded;
}

std::string read_surface(hid_t file, scene::SurfaceSpec& surface) {
  const Handle group = open_group(file, paths::kSurface);
  const AttributeReader read(group);
  archive_surface(read, surface);
  read_layout(group, surface);
  if (const std::string problem = scene::validate(surface); !problem.empty()) throw Hdf5Error(problem);
  std::optional<std::string> models;
  read(kActuator, models);
  return models.value_or(actuator_names(surface));
}

}  // namespace smartsurf::record
