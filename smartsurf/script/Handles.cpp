// object(id) and objects{…}: the live objects of the running simulation.
#include <array>
#include <string>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Methods.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr const char* kType = "object";

void push_handle(lua_State* L, scene::ObjectId id) {
  new (lua_newuserdatauv(L, sizeof id, 0)) scene::ObjectId(id);
  luaL_setmetatable(L, kType);
}

scene::ObjectId handle_at(lua_State* L, const char* method) {
  const auto* const id = static_cast<const scene::ObjectId*>(luaL_testudata(L, 1, kType));
  if (id == nullptr)
    throw Problem(std::string("object:") + method + ": call it with a colon, object(id):" + method);
  return *id;
}

scene::ObjectId live(const Session& session, lua_State* L, const char* method) {
  require_running(session, std::string("object:") + method);
  const scene::ObjectId id = handle_at(L, method);
  if (!session.host->alive(id))
    throw Problem(std::string("object:") + method + ": there is no object " + std::to_string(id) +
                  " (removed, or never created)");
  return id;
}

int push_vector(lua_State* L, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, v[i]);
  return 3;
}

int id(Session&, lua_State* L) {
  lua_pushinteger(L, static_cast<lua_Integer>(handle_at(L, "id")));
  return 1;
}

int alive(Session& session, lua_State* L) {
  require_running(session, "object:alive");
  lua_pushboolean(L, session.host->alive(handle_at(L, "alive")) ? 1 : 0);
  return 1;
}

int label(Session& session, lua_State* L) {
  const std::string text = session.host->label(live(session, L, "label"));
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

int position(Session& session, lua_State* L) {
  return push_vector(L, session.host->state(live(session, L, "position")).position);
}

int velocity(Session& session, lua_State* L) {
  return push_vector(L, session.host->state(live(session, L, "velocity")).velocity);
}

int angular_velocity(Session& session, lua_State* L) {
  return push_vector(L, session.host->state(live(session, L, "angular_velocity")).angular_velocity);
}

int orientation(Session& session, lua_State* L) {
  const Eigen::Quaterniond q = session.host->state(live(session, L, "orientation")).orientation;
  for (const double part : {q.x(), q.y(), q.z(), q.w()}) lua_pushnumber(L, part);
  return 4;
}

int remove(Session& session, lua_State* L) {
  session.host->remove(live(session, L, "remove"));
  return 0;
}

void require_coordinates(const Eigen::Vector3d& v, const std::string& name) {
  for (int i = 0; i < 3; ++i)
    if (std::abs(v[i]) > 1e6)
      throw Problem(name + "[" + std::to_string(i + 1) + "] = " + show(v[i]) +
                    ": must be in [-1000000, 1000000]");
}

// A list alone is the field that a user means first: push{0, 0, 9} is push{force = {0, 0, 9}}.
void name_lone_list(lua_State* L, const char* field) {
  if (lua_type(L, 2) != LUA_TTABLE || lua_rawlen(L, 2) == 0) return;
  lua_Unsigned values = 0;
  for (lua_pushnil(L); lua_next(L, 2) != 0; lua_pop(L, 1)) ++values;
  if (values != lua_rawlen(L, 2)) return;
  lua_createtable(L, 0, 1);
  lua_pushvalue(L, 2);
  lua_setfield(L, -2, field);
  lua_replace(L, 2);
}

int push(Session& session, lua_State* L) {
  const scene::ObjectId object = live(session, L, "push");
  name_lone_list(L, "force");
  const Fields fields(L, 2, "push", {"force", "point", "seconds"});
  Eigen::Vector3d force, point;
  double seconds = session.spec.world.control_period_s;
  fields.require("force");
  fields.read("force", force);
  if (force.norm() > 1e12) throw Problem("push.force: must not be above 1e12");
  if (fields.has("point")) {
    fields.read("point", point);
    require_coordinates(point, "push.point");
  }
  fields.read("seconds", seconds);
  if (seconds <= 0.0 || seconds > 1e9)
    throw Problem("push.seconds = " + show(seconds) + ": must be in (0, 1e9]");
  session.host->push(object, force, fields.has("point") ? std::optional(point) : std::nullopt, seconds);
  return 0;
}

int teleport(Session& session, lua_State* L) {
  const scene::ObjectId object = live(session, L, "teleport");
  name_lone_list(L, "position");
  const Fields fields(L, 2, "teleport", {"position", "orientation", "velocity", "angular_velocity"});
  Placement placement;
  const auto read_vector = [&](const char* field, std::optional<Eigen::Vector3d>& value) {
    fields.with(field, [&](int i, const std::string& name) {
      value = vector_at(L, i, name);
      require_coordinates(*value, name);
    });
  };
  read_vector("position", placement.position);
  read_vector("velocity", placement.velocity);
  read_vector("angular_velocity", placement.angular_velocity);
  fields.with("orientation",
              [&](int i, const std::string& name) { placement.orientation = orientation_at(L, i, name); });
  if (!placement.position && !placement.velocity && !placement.angular_velocity && !placement.orientation)
    throw Problem("teleport: needs position, orientation, velocity or angular_velocity");
  session.host->place(object, placement);
  return 0;
}

int object(Session& session, lua_State* L) {
  require_running(session, "object");
  if (luaL_testudata(L, 1, kType) != nullptr) {
    lua_settop(L, 1);
    return 1;
  }
  push_handle(L, static_cast<scene::ObjectId>(integer_at(L, 1, "object: id", 0, UINT32_MAX)));
  return 1;
}

int objects(Session& session, lua_State* L) {
  require_running(session, "objects");
  std::optional<std::string> wanted;
  if (lua_gettop(L) > 0) {
    const Fields fields(L, 1, "objects", {"label"});
    fields.with("label", [&](int i, const std::string& name) { wanted = text_at(L, i, name); });
  }
  const std::vector<scene::ObjectId> ids = session.host->objects(wanted);
  session.interpreter->charge(L, ids.size());
  lua_createtable(L, static_cast<int>(ids.size()), 0);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    push_handle(L, ids[i]);
    lua_rawseti(L, -2, static_cast<lua_Integer>(i + 1));
  }
  return 1;
}

int equal(Session&, lua_State* L) {
  const auto* const a = static_cast<const scene::ObjectId*>(luaL_testudata(L, 1, kType));
  const auto* const b = static_cast<const scene::ObjectId*>(luaL_testudata(L, 2, kType));
  lua_pushboolean(L, a != nullptr && b != nullptr && *a == *b ? 1 : 0);
  return 1;
}

int text(Session&, lua_State* L) {
  lua_pushfstring(L, "object %I", static_cast<LUAI_UACINT>(handle_at(L, "id")));
  return 1;
}

}  // namespace

void bind_handles(lua_State* L) {
  constexpr std::array<luaL_Reg, 10> kMethods{{{"id", guarded<id>},
                                               {"alive", guarded<alive>},
                                               {"label", guarded<label>},
                                               {"position", guarded<position>},
                                               {"velocity", guarded<velocity>},
                                               {"angular_velocity", guarded<angular_velocity>},
                                               {"orientation", guarded<orientation>},
                                               {"remove", guarded<remove>},
                                               {"push", guarded<push>},
                                               {"teleport", guarded<teleport>}}};
  make_type(L, kType, kMethods);
  luaL_getmetatable(L, kType);
  lua_pushcfunction(L, guarded<equal>);
  lua_setfield(L, -2, "__eq");
  lua_pushcfunction(L, guarded<text>);
  lua_setfield(L, -2, "__tostring");
  lua_pop(L, 1);
  lua_register(L, "object", guarded<object>);
  lua_register(L, "objects", guarded<objects>);
}

}  // namespace smartsurf::script
