// object(id) and objects{…}: handles to the objects of the running simulation.
#include <array>
#include <string>

#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/TableReader.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

constexpr const char* kTypeName = "object";

scene::ObjectId check_live_object(const ScriptContext& context, lua_State* L, const char* method) {
  // The subject is a string, which would cost a reward function more than the check.
  if (context.phase != Phase::kRunning) require_running(context, std::string("object:") + method);
  const scene::ObjectId id = check_handle(L, kTypeName, method);
  if (!context.simulation->is_alive(id))
    throw ScriptError(std::string("object:") + method + ": there is no object " + std::to_string(id) +
                      " (removed, or never created)");
  return id;
}

int push_components(lua_State* L, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, v[i]);
  return 3;
}

int id(ScriptContext&, lua_State* L) {
  lua_pushinteger(L, static_cast<lua_Integer>(check_handle(L, kTypeName, "id")));
  return 1;
}

int alive(ScriptContext& context, lua_State* L) {
  require_running(context, "object:alive");
  lua_pushboolean(L, context.simulation->is_alive(check_handle(L, kTypeName, "alive")) ? 1 : 0);
  return 1;
}

// False for an object that is gone: it is not on the table either.
int on_table(ScriptContext& context, lua_State* L) {
  if (context.phase != Phase::kRunning) require_running(context, "object:on_table");
  const scene::ObjectId id = check_handle(L, kTypeName, "on_table");
  lua_pushboolean(L, context.simulation->is_alive(id) && context.simulation->is_on_table(id) ? 1 : 0);
  return 1;
}

int label(ScriptContext& context, lua_State* L) {
  const std::string text = context.simulation->label(check_live_object(context, L, "label"));
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

int position(ScriptContext& context, lua_State* L) {
  return push_components(L, context.simulation->state(check_live_object(context, L, "position")).position);
}

int velocity(ScriptContext& context, lua_State* L) {
  return push_components(L, context.simulation->state(check_live_object(context, L, "velocity")).velocity);
}

int angular_velocity(ScriptContext& context, lua_State* L) {
  return push_components(
      L, context.simulation->state(check_live_object(context, L, "angular_velocity")).angular_velocity);
}

int orientation(ScriptContext& context, lua_State* L) {
  const Eigen::Quaterniond q =
      context.simulation->state(check_live_object(context, L, "orientation")).orientation;
  for (const double component : {q.x(), q.y(), q.z(), q.w()}) lua_pushnumber(L, component);
  return 4;
}

int remove(ScriptContext& context, lua_State* L) {
  context.simulation->remove(check_live_object(context, L, "remove"));
  return 0;
}

void require_coordinates(const Eigen::Vector3d& v, const std::string& name) {
  for (int i = 0; i < 3; ++i)
    if (std::abs(v[i]) > 1e6)
      throw ScriptError(name + "[" + std::to_string(i + 1) + "] = " + format_value(v[i]) +
                        ": must be in [-1000000, 1000000]");
}

// Shorthand: a plain list is the value of the main field. push{0, 0, 9} means push{force = {0, 0, 9}}.
void wrap_positional_list(lua_State* L, const char* field) {
  if (lua_type(L, 2) != LUA_TTABLE || lua_rawlen(L, 2) == 0) return;
  lua_Unsigned values = 0;
  for (lua_pushnil(L); lua_next(L, 2) != 0; lua_pop(L, 1)) ++values;
  if (values != lua_rawlen(L, 2)) return;
  lua_createtable(L, 0, 1);
  lua_pushvalue(L, 2);
  lua_setfield(L, -2, field);
  lua_replace(L, 2);
}

int push(ScriptContext& context, lua_State* L) {
  const scene::ObjectId object = check_live_object(context, L, "push");
  wrap_positional_list(L, "force");
  const TableReader fields(L, 2, "push", {"force", "point", "seconds"});
  Eigen::Vector3d force, point;
  double seconds = context.spec.world.control_period_s;
  fields.read_required("force", force);
  if (force.norm() > 1e12) throw ScriptError("push.force: must not be above 1e12");
  if (fields.has("point")) {
    fields.read("point", point);
    require_coordinates(point, "push.point");
  }
  fields.read("seconds", seconds);
  if (seconds <= 0.0 || seconds > 1e9)
    throw ScriptError("push.seconds = " + format_value(seconds) + ": must be in (0, 1e9]");
  context.simulation->apply_force(object, force, fields.has("point") ? std::optional(point) : std::nullopt,
                                  seconds);
  return 0;
}

int teleport(ScriptContext& context, lua_State* L) {
  const scene::ObjectId object = check_live_object(context, L, "teleport");
  wrap_positional_list(L, "position");
  const TableReader fields(L, 2, "teleport", {"position", "orientation", "velocity", "angular_velocity"});
  ObjectStateUpdate update;
  const auto read_vector = [&](const char* field, std::optional<Eigen::Vector3d>& value, bool is_speed) {
    fields.visit(field, [&](int i, const std::string& name) {
      value = check_vector(L, i, name);
      require_coordinates(*value, name);
      if (is_speed && !value->isZero(0.0) && context.simulation->is_fixed(object))
        throw ScriptError(name + ": a fixed object stands still: must be {0, 0, 0}; its position can be set");
    });
  };
  read_vector("position", update.position, false);
  read_vector("velocity", update.velocity, true);
  read_vector("angular_velocity", update.angular_velocity, true);
  fields.visit("orientation",
               [&](int i, const std::string& name) { update.orientation = check_orientation(L, i, name); });
  if (!update.position && !update.velocity && !update.angular_velocity && !update.orientation)
    throw ScriptError("teleport: needs position, orientation, velocity or angular_velocity");
  context.simulation->set_state(object, update);
  return 0;
}

int object(ScriptContext& context, lua_State* L) {
  if (lua_istable(L, 1))
    throw ScriptError("object: takes an object's id; sphere { … }, box { … } and their like make objects");
  require_running(context, "object");
  if (test_handle(L, 1, kTypeName) != nullptr) {
    lua_settop(L, 1);
    return 1;
  }
  push_handle(L, kTypeName, static_cast<scene::ObjectId>(check_integer(L, 1, "object: id", 0, UINT32_MAX)));
  return 1;
}

int objects(ScriptContext& context, lua_State* L) {
  require_running(context, "objects");
  std::optional<std::string> label_filter;
  if (lua_gettop(L) > 0) {
    const TableReader fields(L, 1, "objects", {"label"});
    fields.visit("label", [&](int i, const std::string& name) { label_filter = check_string(L, i, name); });
  }
  const std::vector<scene::ObjectId> ids = context.simulation->find_objects(label_filter);
  context.interpreter->charge(L, ids.size());
  lua_createtable(L, static_cast<int>(ids.size()), 0);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    push_handle(L, kTypeName, ids[i]);
    lua_rawseti(L, -2, static_cast<lua_Integer>(i + 1));
  }
  return 1;
}

}  // namespace

void bind_object_handles(lua_State* L) {
  constexpr std::array<luaL_Reg, 11> kMethods{{{"id", guarded<id>},
                                               {"alive", guarded<alive>},
                                               {"on_table", guarded<on_table>},
                                               {"label", guarded<label>},
                                               {"position", guarded<position>},
                                               {"velocity", guarded<velocity>},
                                               {"angular_velocity", guarded<angular_velocity>},
                                               {"orientation", guarded<orientation>},
                                               {"remove", guarded<remove>},
                                               {"push", guarded<push>},
                                               {"teleport", guarded<teleport>}}};
  register_handle_type(L, kTypeName, kMethods);
  lua_register(L, "object", guarded<object>);
  lua_register(L, "objects", guarded<objects>);
}

}  // namespace smartsurf::script
