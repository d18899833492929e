// sphere, box, cylinder: declared while the script loads, spawned while the simulation runs.
#include <string>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kMostObjects = 1'000'000;
constexpr std::size_t kLongestLabel = 100;

void read_common(const Session& session, lua_State* L, const Fields& fields, scene::ObjectSpec& object) {
  fields.read("position", object.position);
  fields.read("orientation", object.orientation);
  fields.read("velocity", object.velocity);
  fields.read("angular_velocity", object.angular_velocity);
  fields.read("mass", object.mass);
  fields.read("fixed", object.fixed);
  fields.read("colour", object.colour);
  fields.read("pole", object.pole);
  fields.read("moment", object.moment);
  fields.with("material",
              [&](int i, const std::string& name) { object.material = material_at(session, L, i, name); });
  fields.with("label", [&](int i, const std::string& name) {
    object.label = text_at(L, i, name);
    if (object.label.size() > kLongestLabel || one_line(object.label) != object.label)
      must_be(L, i, name, "at most 100 characters in one line");
  });
}

// Id numbers are those of recordings and of the view: from 0, in the order of creation.
int add(Session& session, lua_State* L, const std::string& what, const scene::ObjectSpec& object) {
  if (const std::string problem = problem_with(object); !problem.empty()) throw Problem(what + "." + problem);
  scene::ObjectId id = 0;
  if (session.phase == Phase::kRunning) {
    id = session.host->spawn(object);
  } else {
    auto& objects = session.spec.objects;
    if (objects.size() >= kMostObjects) throw Problem(what + ": more than 1000000 objects");
    id = static_cast<scene::ObjectId>(objects.size());
    objects.push_back(object);
  }
  lua_pushinteger(L, static_cast<lua_Integer>(id));
  return 1;
}

int sphere(Session& session, lua_State* L) {
  const Fields fields(L, 1, "sphere",
                      {"radius", "position", "orientation", "velocity", "angular_velocity", "mass", "fixed",
                       "material", "colour", "label", "pole", "moment"});
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kSphere;
  fields.require("radius");
  fields.read("radius", object.radius);
  fields.require("position");
  read_common(session, L, fields, object);
  return add(session, L, "sphere", object);
}

int box(Session& session, lua_State* L) {
  const Fields fields(L, 1, "box",
                      {"size", "position", "orientation", "velocity", "angular_velocity", "mass", "fixed",
                       "material", "colour", "label", "pole", "moment"});
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kBox;
  fields.require("size");
  fields.read("size", object.size);
  fields.require("position");
  read_common(session, L, fields, object);
  return add(session, L, "box", object);
}

int cylinder(Session& session, lua_State* L) {
  const Fields fields(L, 1, "cylinder",
                      {"radius", "height", "position", "orientation", "velocity", "angular_velocity", "mass",
                       "fixed", "material", "colour", "label", "pole", "moment"});
  scene::ObjectSpec object;
  object.shape = scene::ShapeKind::kCylinder;
  fields.require("radius");
  fields.read("radius", object.radius);
  fields.require("height");
  fields.read("height", object.height);
  fields.require("position");
  read_common(session, L, fields, object);
  return add(session, L, "cylinder", object);
}

}  // namespace

void bind_objects(lua_State* L) {
  lua_register(L, "sphere", guarded<sphere>);
  lua_register(L, "box", guarded<box>);
  lua_register(L, "cylinder", guarded<cylinder>);
}

}  // namespace smartsurf::script
