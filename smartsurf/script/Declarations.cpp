// world, material, surface, faults, record: what a script declares once, while it loads.
#include <algorithm>
#include <string>
#include <vector>

#include "smartsurf/scene/Occupancy.h"
#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Files.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostMaterials = 1000;

void check(const std::string& problem) {
  if (!problem.empty()) throw Problem(problem);
}

int world(Session& session, lua_State* L) {
  declare_once(session, L, "world");
  const Fields fields(L, 1, "world",
                      {"gravity", "dt", "iterations", "control_period", "seed", "ground", "off_table"});
  scene::WorldSpec& spec = session.spec.world;
  fields.with("gravity", [&](int i, const std::string& name) {
    if (lua_type(L, i) == LUA_TNUMBER)
      spec.gravity = {0.0, 0.0, number_at(L, i, name)};
    else if (lua_type(L, i) == LUA_TTABLE)
      spec.gravity = vector_at(L, i, name);
    else
      must_be(L, i, name, "a number (along z) or {x, y, z}");
  });
  fields.read("dt", spec.dt_s);
  fields.read("iterations", spec.iterations, 1, 1000);
  fields.read("control_period", spec.control_period_s);
  fields.read("ground", spec.ground);
  fields.with("off_table", [&](int i, const std::string& name) {
    const std::string wanted = text_at(L, i, name);
    if (wanted != "keep" && wanted != "remove") must_be(L, i, name, "'keep' or 'remove'");
    spec.off_table = wanted == "keep" ? scene::OffTable::kKeep : scene::OffTable::kRemove;
  });
  fields.with("seed", [&](int i, const std::string& name) {
    const auto seed = static_cast<std::uint64_t>(integer_at(L, i, name, 0, INT64_MAX));
    if (session.options.seed) return;  // --seed wins
    if (session.random && seed != spec.seed)
      throw Problem("world.seed = " + std::to_string(seed) +
                    ": random numbers were already drawn with seed " + std::to_string(spec.seed) + " at " +
                    session.random_used_at + "; put world{} before");
    spec.seed = seed;
  });
  check(problem_with(spec));
  return 0;
}

int material(Session& session, lua_State* L) {
  require_loading(session, "material");
  const Fields fields(L, 1, "material", {"name", "friction", "rolling_friction", "restitution", "density"});
  fields.require("name");
  scene::Material m;
  fields.read("name", m.name);
  fields.read("friction", m.friction);
  fields.read("rolling_friction", m.rolling_friction);
  fields.read("restitution", m.restitution);
  fields.read("density", m.density);
  check(problem_with(m));
  declare_once(session, L, "material '" + one_line(m.name.substr(0, 60)) + "'");
  auto& all = session.spec.materials;
  if (m.name == all[0].name) {
    all[0] = m;  // "default" is there from the beginning, and may be changed
  } else {
    if (all.size() >= kMostMaterials) throw Problem("material: more than 1000 materials");
    all.push_back(m);
  }
  return 0;
}

int surface(Session& session, lua_State* L) {
  declare_once(session, L, "surface");
  const Fields fields(L, 1, "surface",
                      {"rows", "columns", "pitch", "actuator", "actuators", "cells", "mask", "layout",
                       "positions", "modules", "base", "tilt", "sensors", "border", "material"});
  scene::SurfaceSpec& spec = session.spec.surface;
  fields.read("rows", spec.rows, 1, 4096);
  fields.read("columns", spec.columns, 1, 4096);
  fields.read("pitch", spec.pitch);
  if (!(spec.pitch > 0.0)) check(problem_with(spec));
  read_layout(session, L, fields, spec);
  fields.with("sensors",
              [&](int i, const std::string& name) { read_sensors(session, L, i, name, spec.sensors); });
  fields.with("border", [&](int i, const std::string& name) {
    const Fields border(L, i, name, {"height"});
    border.require("height");
    border.read("height", spec.border_height);
  });
  fields.with("material",
              [&](int i, const std::string& name) { spec.material = material_at(session, L, i, name); });
  check(problem_with(spec));
  session.channels = channels_of(spec.sensors);
  if (has_empty_cells(spec)) session.channels.push_back({.name = scene::kOccupancy});
  return 0;
}

int faults(Session& session, lua_State* L) {
  declare_once(session, L, "faults");
  const Fields fields(L, 1, "faults", {"actuator", "sensor", "map"});
  scene::FaultSpec& spec = session.spec.surface.faults;
  fields.with("actuator",
              [&](int i, const std::string& name) { read_actuator_faults(L, i, name, spec.actuator); });
  fields.with("sensor", [&](int i, const std::string& name) { read_sensor_faults(L, i, name, spec.sensor); });
  fields.with("map", [&](int i, const std::string& name) {
    NamedText file = text_of_file(session, name, text_at(L, i, name));
    spec.map = {std::move(file.name), std::move(file.text)};
  });
  return 0;
}

int record(Session& session, lua_State* L) {
  declare_once(session, L, "record");
  const Fields fields(L, 1, "record", {"objects", "sensors", "actuators", "every"});
  scene::RecordSpec& spec = session.spec.record;
  fields.read("objects", spec.objects);
  fields.read("sensors", spec.sensors);
  fields.read("actuators", spec.actuators);
  fields.read("every", spec.every, 1, 1'000'000);
  return 0;
}

}  // namespace

int material_at(const Session& session, lua_State* L, int index, const std::string& name) {
  const std::string wanted = text_at(L, index, name);
  std::vector<std::string> names;
  const auto& all = session.spec.materials;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == wanted) return static_cast<int>(i);
    names.push_back(all[i].name);
  }
  const std::string near = suggestion(wanted, names);
  throw Problem(name + " = " + show(L, index) + ": no such material" +
                (near.empty() ? "; known: " + list_of(names) + "; declare it before with material{}" : near));
}

void bind_declarations(lua_State* L) {
  lua_register(L, "world", guarded<world>);
  lua_register(L, "material", guarded<material>);
  lua_register(L, "surface", guarded<surface>);
  lua_register(L, "faults", guarded<faults>);
  lua_register(L, "record", guarded<record>);
}

}  // namespace smartsurf::script
