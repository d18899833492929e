// world, material, surface, faults, record: declarations that a script makes once, while it loads.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <vector>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/declarations/ParameterReader.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMaxMaterials = 1000;

int world(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "world");
  const TableReader fields(L, 1, "world",
                           {"unit", "gravity", "dt", "iterations", "control_period", "seed", "ground",
                            "sleep", "off_table", "engine"});
  scene::WorldSpec& spec = context.spec.world;
  fields.visit("unit", [&](int i, const std::string& name) {
    spec.unit = check_physical_unit(L, i, name);
    spec.gravity = {0.0, 0.0, -scene::kStandardGravity / spec.unit->metres};
  });
  fields.visit("gravity", [&](int i, const std::string& name) {
    if (lua_type(L, i) == LUA_TNUMBER)
      spec.gravity = {0.0, 0.0, check_number(L, i, name)};
    else if (lua_type(L, i) == LUA_TTABLE)
      spec.gravity = check_vector(L, i, name);
    else
      throw_invalid_value(L, i, name, "a number (along z) or {x, y, z}");
  });
  fields.read("dt", spec.dt_s);
  fields.read("iterations", spec.iterations, 1, 1000);
  fields.read("control_period", spec.control_period_s);
  fields.read("ground", spec.ground);
  fields.read("sleep", spec.sleep);
  fields.visit("engine", [&](int i, const std::string& name) {
    const std::string engine = check_string(L, i, name);
    if (std::ranges::find(scene::kEngineNames, engine) == std::end(scene::kEngineNames))
      throw_invalid_value(L, i, name, "'native' or 'bullet'");
    if (!context.options.engine) spec.engine = engine;  // --engine overrides world.engine
  });
  fields.visit("off_table", [&](int i, const std::string& name) {
    const std::string policy = check_string(L, i, name);
    if (policy != "keep" && policy != "remove") throw_invalid_value(L, i, name, "'keep' or 'remove'");
    spec.off_table = policy == "keep" ? scene::OffTablePolicy::kKeep : scene::OffTablePolicy::kRemove;
  });
  fields.visit("seed", [&](int i, const std::string& name) {
    const auto seed = static_cast<std::uint64_t>(check_integer(L, i, name, 0, INT64_MAX));
    if (context.options.seed) return;  // --seed overrides world.seed
    if (context.has_drawn() && seed != spec.seed)
      throw ScriptError("world.seed = " + std::to_string(seed) +
                        ": random numbers were already drawn with seed " + std::to_string(spec.seed) +
                        " at " + context.random_first_use + "; declare world{} before that");
    spec.seed = seed;
  });
  throw_if_invalid(validate(spec));
  return 0;
}

int material(ScriptContext& context, lua_State* L) {
  require_loading(context, "material");
  const TableReader fields(L, 1, "material",
                           {"name", "friction", "rolling_friction", "restitution", "density", "look"});
  fields.require("name");
  scene::Material m;
  fields.read("name", m.name);
  fields.read("friction", m.friction);
  fields.read("rolling_friction", m.rolling_friction);
  fields.read("restitution", m.restitution);
  fields.read("density", m.density);
  fields.visit("look", [&](int i, const std::string& name) {
    const std::vector<std::string> looks(scene::kLookNames.begin(), scene::kLookNames.end());
    m.look = check_choice(L, i, name, looks);
  });
  throw_if_invalid(validate(m));
  declare_once(context, L, "material '" + m.name + "'",
               "material '" + to_single_line(m.name.substr(0, 60)) + "'");
  auto& all = context.spec.materials;
  if (m.name == all[0].name) {
    all[0] = m;  // the predefined material "default" may be redefined
  } else {
    if (all.size() >= kMaxMaterials) throw ScriptError("material: more than 1000 materials");
    all.push_back(m);
  }
  return 0;
}

// Reads surface.skin. Requires that layout and border have been read.
scene::SkinSpec check_skin(lua_State* L, int index, const std::string& name,
                           const scene::SurfaceSpec& surface) {
  const TableReader fields(L, index, name,
                           {"kind", "nodes", "margin", "edge", "tension", "density", "damping", "attached"});
  scene::SkinSpec skin;
  fields.visit("kind", [&](int i, const std::string& kind_name) {
    const std::string kind = check_string(L, i, kind_name);
    if (kind != "kinematic" && kind != "elastic")
      throw_invalid_value(L, i, kind_name, "'kinematic' or 'elastic'");
    if (kind == "elastic") skin.kind = scene::SkinSpec::Kind::kElastic;
  });
  for (const char* field : {"tension", "density", "damping", "attached"})
    if (skin.kind == scene::SkinSpec::Kind::kKinematic && fields.has(field))
      throw ScriptError(name + "." + field + ": a skin of the kind 'kinematic' has none");
  fields.read("tension", skin.tension);
  fields.read("density", skin.density);
  skin.damping = scene::SkinSpec::kDampingTime_s * skin.tension;
  fields.read("damping", skin.damping);
  fields.read("attached", skin.attached);
  const double half_top = 0.5 * std::min(surface.pin.top_x, surface.pin.top_y);
  skin.margin = surface.border_height ? surface.pitch - half_top : 0.5 * surface.pitch;
  fields.read("margin", skin.margin);
  fields.visit("edge", [&](int i, const std::string& edge_name) {
    if (lua_type(L, i) == LUA_TSTRING && check_string(L, i, edge_name) == "free") return;
    if (lua_type(L, i) != LUA_TTABLE) throw_invalid_value(L, i, edge_name, "'free' or {height = z}");
    const TableReader edge(L, i, edge_name, {"height"});
    edge.read_required("height", skin.edge_height);
    skin.edge = scene::SkinSpec::Edge::kClamped;
  });
  // Eight to a pitch, fewer over many cells.
  constexpr double kNodesPerPitch = 8.0, kMaxNodes = 257.0;
  const auto default_nodes = [&](int cells) {
    const double pitches = cells - (surface.border_height ? 3 : 1) + 2.0 * skin.margin / surface.pitch;
    return static_cast<int>(
               std::ceil(std::max(std::min(kNodesPerPitch * pitches, kMaxNodes - 1.0), 2.0 * pitches))) +
           1;
  };
  skin.rows = default_nodes(surface.rows), skin.columns = default_nodes(surface.columns);
  fields.visit("nodes", [&](int i, const std::string& nodes_name) {
    const std::string requirement = "{rows, columns}, two integers";
    const std::vector<double> nodes = check_numbers(L, i, nodes_name, 2, requirement);
    for (const double n : nodes)
      if (n != std::floor(n) || std::abs(n) > 1e6) throw_invalid_value(L, i, nodes_name, requirement);
    skin.rows = static_cast<int>(nodes[0]), skin.columns = static_cast<int>(nodes[1]);
  });
  return skin;
}

int surface(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "surface");
  const TableReader fields(L, 1, "surface",
                           {"rows", "columns", "pitch", "actuator", "actuators", "cells", "mask", "layout",
                            "positions", "modules", "base", "tilt", "sensors", "border", "skin", "material"});
  scene::SurfaceSpec& spec = context.spec.surface;
  fields.read("rows", spec.rows, 1, 4096);
  fields.read("columns", spec.columns, 1, 4096);
  fields.read("pitch", spec.pitch);
  if (!(spec.pitch > 0.0)) throw_if_invalid(validate(spec));
  read_layout(context, L, fields, spec);
  fields.visit("sensors",
               [&](int i, const std::string& name) { read_sensors(context, L, i, name, spec.sensors); });
  fields.visit("border", [&](int i, const std::string& name) {
    const TableReader border(L, i, name, {"height"});
    border.read_required("height", spec.border_height);
  });
  fields.visit("skin", [&](int i, const std::string& name) { spec.skin = check_skin(L, i, name, spec); });
  fields.visit("material",
               [&](int i, const std::string& name) { spec.material = check_material(context, L, i, name); });
  throw_if_invalid(validate(spec));
  for (const scene::SensorSpec& sensor : spec.sensors)
    if (!spec.skin && sensor.model.starts_with("skin_"))
      throw ScriptError("surface.skin: is absent: must be there for the sensor '" + sensor.name + "'");
  context.channels = spec.observed_channels();
  return 0;
}

int faults(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "faults");
  const TableReader fields(L, 1, "faults", {"actuator", "sensor", "map"});
  scene::FaultSpec& spec = context.spec.surface.faults;
  fields.visit("actuator",
               [&](int i, const std::string& name) { read_actuator_faults(L, i, name, spec.actuator); });
  fields.visit("sensor",
               [&](int i, const std::string& name) { read_sensor_faults(L, i, name, spec.sensor_errors); });
  fields.visit("map", [&](int i, const std::string& name) {
    NamedFile file = read_sandboxed_file(context, name, check_string(L, i, name));
    spec.fault_map = {std::move(file.name), std::move(file.content)};
  });
  return 0;
}

int record(ScriptContext& context, lua_State* L) {
  declare_once(context, L, "record");
  const TableReader fields(L, 1, "record", {"objects", "sensors", "actuators", "every"});
  scene::RecordSpec& spec = context.spec.record;
  fields.read("objects", spec.objects);
  fields.visit("sensors", [&](int i, const std::string& name) {
    bool all = false;
    check_value(L, i, name, all);
    spec.sensors = all ? scene::SensorRecording::kAlways : scene::SensorRecording::kNever;
  });
  fields.read("actuators", spec.actuators);
  fields.read("every", spec.tick_interval, 1, 1'000'000);
  return 0;
}

}  // namespace

int check_material(const ScriptContext& context, lua_State* L, int index, const std::string& name) {
  const std::string sought = check_string(L, index, name);
  std::vector<std::string> names;
  const auto& all = context.spec.materials;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == sought) return static_cast<int>(i);
    names.push_back(all[i].name);
  }
  const std::string hint = did_you_mean(sought, names);
  throw ScriptError(
      name + " = " + format_value(L, index) + ": no such material" +
      (hint.empty() ? "; known: " + join_names(names) + "; declare it first with material{}" : hint));
}

scene::PhysicalUnit check_physical_unit(lua_State* L, int index, const std::string& name) {
  const auto unit = scene::find_physical_unit(check_string(L, index, name));
  if (!unit) throw_invalid_value(L, index, name, "'mm', 'cm', 'in' or 'm'");
  return *unit;
}

void bind_declarations(lua_State* L) {
  lua_register(L, "world", guarded<world>);
  lua_register(L, "material", guarded<material>);
  lua_register(L, "surface", guarded<surface>);
  lua_register(L, "faults", guarded<faults>);
  lua_register(L, "record", guarded<record>);
}

}  // namespace smartsurf::script
