// MJCF, MuJoCo's modelling format: bodies nested in each other, with geoms and joints, and defaults by class.
#include <algorithm>
#include <map>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/model/Model.h"
#include "smartsurf/model/XmlFile.h"
#include "smartsurf/scene/Axes.h"

namespace smartsurf::model {
namespace {

constexpr double kDefaultDensity = 1000.0;  // MuJoCo's
constexpr double kDegree = std::numbers::pi / 180.0;

struct DefaultClass {
  std::string parent;                                    // "" for the outermost
  std::map<std::string, std::vector<Element>> elements;  // by tag; attributes of later ones replace earlier
};

// An element of a body, in the frame that the <frame> elements between them give it.
struct Placed {
  Element element;
  Pose frame;
  std::string child_class;
};

struct Mesh {
  std::string file;
  double scale;
};

// An element with the defaults of its class.
class Defaulted {
 public:
  Defaulted(const Element& e, std::vector<Element> defaults) : element_(e), defaults_(std::move(defaults)) {}

  const Element& element() const { return element_; }
  // The element, or the first of the defaults that has the attribute, or any of them.
  const Element& with(const char* attribute) const { return with_any({&attribute, 1}); }
  const Element& with_any(std::span<const char* const> attributes) const {
    const auto has_any = [&](const Element& e) {
      return std::ranges::any_of(attributes, [&](const char* attribute) { return e.has(attribute); });
    };
    if (has_any(element_)) return element_;
    const auto found = std::ranges::find_if(defaults_, has_any);
    return found != defaults_.end() ? *found : element_;
  }
  bool has(const char* attribute) const { return with(attribute).has(attribute); }
  std::string text(const char* attribute, const char* otherwise) const {
    return has(attribute) ? with(attribute).text(attribute) : otherwise;
  }
  double number(const char* attribute, double otherwise) const {
    return with(attribute).number(attribute, otherwise);
  }
  double magnitude(const char* attribute) const { return with(attribute).magnitude(attribute); }
  std::vector<double> numbers(const char* attribute, std::size_t least, std::size_t most) const {
    return with(attribute).numbers(attribute, least, most);
  }
  Eigen::Vector3d vector(const char* attribute, const Eigen::Vector3d& otherwise) const {
    return with(attribute).vector(attribute, otherwise);
  }

 private:
  Element element_;
  std::vector<Element> defaults_;
};

class MjcfReader {
 public:
  explicit MjcfReader(const Element& mujoco) {
    model_.name = mujoco.text("model");
    classes_["main"];
    for (const char* const tag : {"equality", "tendon"})
      if (const Element e = mujoco.child(tag); e && !e.children().empty())
        e.refuse("is not supported: only joints constrain the bodies");
    refuse_generators(mujoco);
    for (const Element& e : mujoco.children("compiler")) read_compiler(e);
    for (const Element& e : mujoco.children("default")) read_defaults(e, "");
    for (const Element& e : mujoco.children("asset")) read_assets(e);
    const std::vector<Element> worlds = mujoco.children("worldbody");
    for (const Element& e : worlds) collect_names(e);
    for (const Element& e : worlds)
      for (const Placed& geom : placed_children(e, "geom", "main")) add_fixed_geom(geom);
    for (const Element& e : worlds)
      for (const Placed& body : placed_children(e, "body", "main"))
        add_body(body.element, body.frame, -1, body.child_class);
    if (model_.bodies.empty()) mujoco.refuse("has no bodies");
    if (inertia_from_geom_ != "false") return;
    for (const Body& body : model_.bodies)
      if (!body.fixed && !(body.inertial.mass > 0.0))
        throw scene::InputError(body.where +
                                ": has no mass: give it an <inertial>, or leave out inertiafromgeom='false'");
  }
  Model take() { return std::move(model_); }

 private:
  // Without the elements that they stand for, the model would be another one.
  static void refuse_generators(const Element& e) {
    for (const Element& child : e.children()) {
      for (const char* const tag : {"include", "replicate", "attach", "composite", "flexcomp"})
        if (child.is(tag)) child.refuse("is not read: write the elements that it stands for into the file");
      refuse_generators(child);
    }
  }

  // Attributes of later elements replace those of earlier ones.
  void read_compiler(const Element& e) {
    if (e.has("angle") && e.text("angle") != "degree" && e.text("angle") != "radian")
      e.refuse("angle='" + e.text("angle") + "': must be degree or radian");
    if (e.has("angle")) angle_unit_ = e.text("angle") == "radian" ? 1.0 : kDegree;
    if (e.text("coordinate") == "global") e.refuse("coordinate='global': must be local");
    if (e.has("eulerseq")) euler_sequence_ = e.text("eulerseq");
    if (euler_sequence_.size() != 3 || euler_sequence_.find_first_not_of("xyzXYZ") != std::string::npos)
      e.refuse("eulerseq='" + euler_sequence_ + "': must be three of x, y, z, X, Y, Z");
    if (e.has("autolimits") && e.text("autolimits") != "false" && e.text("autolimits") != "true")
      e.refuse("autolimits='" + e.text("autolimits") + "': must be false or true");
    if (e.has("autolimits")) autolimits_ = e.text("autolimits") == "true";
    if (e.has("inertiafromgeom")) inertia_from_geom_ = e.text("inertiafromgeom");
    if (inertia_from_geom_ != "false" && inertia_from_geom_ != "true" && inertia_from_geom_ != "auto")
      e.refuse("inertiafromgeom='" + inertia_from_geom_ + "': must be false, true or auto");
    for (const char* const folder : {"assetdir", "meshdir"})
      if (e.has(folder)) mesh_folder_ = e.text(folder);
  }

  void read_defaults(const Element& e, const std::string& parent) {
    const std::string name = parent.empty() && !e.has("class") ? "main" : e.required_text("class");
    DefaultClass& all = classes_[name];
    if (name != "main") all.parent = parent.empty() ? "main" : parent;
    std::set<std::string> tags;
    for (const Element& child : e.children()) {
      if (child.is("default")) {
        read_defaults(child, name);
        continue;
      }
      if (!tags.insert(child.tag()).second) child.refuse("is found twice in a <default>: must be there once");
      all.elements[child.tag()].push_back(child);
    }
  }

  void read_assets(const Element& assets) {
    for (const Element& e : assets.children("mesh")) {
      const std::string file = e.required_text("file");
      std::string name = e.text("name");
      if (name.empty()) name = file.substr(0, file.rfind('.')).substr(file.find_last_of('/') + 1);
      meshes_[name] = {mesh_folder_.empty() ? file : mesh_folder_ + "/" + file, e.uniform_scale()};
    }
    for (const Element& e : assets.children("material"))
      if (e.has("rgba")) materials_.emplace(e.text("name"), e);
  }

  Defaulted defaulted(const Element& e, const char* tag, const std::string& child_class) const {
    std::string name = e.has("class") ? e.text("class") : child_class;
    std::vector<Element> defaults;
    for (std::size_t steps = 0; !name.empty();) {
      const auto found = classes_.find(name);
      if (found == classes_.end()) e.refuse("class '" + name + "': there is no such class of defaults");
      if (const auto own = found->second.elements.find(tag); own != found->second.elements.end())
        defaults.insert(defaults.end(), own->second.rbegin(), own->second.rend());
      name = found->second.parent;
      if (++steps > classes_.size()) e.refuse("its class is its own ancestor");
    }
    return {e, std::move(defaults)};
  }

  // An orientation takes the place of the defaults', whatever the notations.
  Eigen::Quaterniond read_orientation(const Defaulted& defaulted) const {
    static constexpr const char* kNotations[] = {"quat", "axisangle", "euler", "zaxis", "xyaxes"};
    const Element& e = defaulted.with_any(kNotations);
    if (std::ranges::count_if(kNotations, [&](const char* notation) { return e.has(notation); }) > 1)
      e.refuse("has several orientations: must be one of quat, axisangle, euler, zaxis and xyaxes");
    if (e.has("quat")) {
      const auto q = e.numbers("quat", 4, 4);
      const Eigen::Quaterniond quat(q[0], q[1], q[2], q[3]);
      if (!(quat.norm() > 1e-9)) e.refuse("quat: must not be of length 0");
      return quat.normalized();
    }
    if (e.has("axisangle")) {
      const auto a = e.numbers("axisangle", 4, 4);
      const Eigen::Vector3d axis(a[0], a[1], a[2]);
      if (!(axis.norm() > 1e-9)) e.refuse("axisangle: the axis must not be of length 0");
      return Eigen::Quaterniond(Eigen::AngleAxisd(a[3] * angle_unit_, axis.normalized()));
    }
    if (e.has("euler")) return from_euler(e.vector("euler", Eigen::Vector3d::Zero()));
    if (e.has("zaxis")) return along_z(e, e.vector("zaxis", Eigen::Vector3d::UnitZ()));
    if (e.has("xyaxes")) {
      const auto a = e.numbers("xyaxes", 6, 6);
      Eigen::Matrix3d axes;
      axes.col(0) = Eigen::Vector3d(a[0], a[1], a[2]).normalized();
      axes.col(1) = Eigen::Vector3d(a[3], a[4], a[5]);
      axes.col(1) = (axes.col(1) - axes.col(0).dot(axes.col(1)) * axes.col(0)).normalized();
      axes.col(2) = axes.col(0).cross(axes.col(1));
      if (!(std::abs(axes.determinant() - 1.0) < 1e-6)) e.refuse("xyaxes: must be two directions");
      return Eigen::Quaterniond(axes).normalized();
    }
    return Eigen::Quaterniond::Identity();
  }

  // Lower case: about the axes that turn with the body; upper case: about the fixed ones.
  Eigen::Quaterniond from_euler(const Eigen::Vector3d& angles) const {
    Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
    for (int i = 0; i < 3; ++i) {
      const char axis = euler_sequence_[i];
      const bool is_fixed = axis < 'a';
      const Eigen::Quaterniond turn(
          Eigen::AngleAxisd(angles[i] * angle_unit_, Eigen::Vector3d::Unit(axis - (is_fixed ? 'X' : 'x'))));
      q = is_fixed ? turn * q : q * turn;
    }
    return q;
  }

  static Eigen::Quaterniond along_z(const Element& e, const Eigen::Vector3d& direction) {
    if (!(direction.norm() > 1e-9)) e.refuse("the direction must not be of length 0");
    return scene::rotation_between(Eigen::Vector3d::UnitZ(), direction.normalized());
  }

  Pose read_pose(const Defaulted& e) const {
    return {e.vector("pos", Eigen::Vector3d::Zero()), read_orientation(e)};
  }

  // The children of that tag, also those in frames.
  std::vector<Placed> placed_children(const Element& e, const char* tag,
                                      const std::string& child_class) const {
    std::vector<Placed> all;
    add_placed_children(e, tag, child_class, {}, all);
    return all;
  }

  void add_placed_children(const Element& e, const char* tag, const std::string& child_class,
                           const Pose& frame, std::vector<Placed>& all) const {
    for (const Element& child : e.children()) {
      if (child.is(tag)) all.push_back({child, frame, child_class});
      if (!child.is("frame")) continue;
      if (const Element inertial = child.child("inertial"))
        inertial.refuse("is in a <frame>: must be in the body itself");
      add_placed_children(child, tag, child.has("childclass") ? child.text("childclass") : child_class,
                          frame * read_pose({child, {}}), all);
    }
  }

  Geometry read_geom(const Defaulted& e) const {
    Geometry g;
    g.where = e.element().where();
    g.pose = read_pose(e);
    const std::string type = e.text("type", e.has("mesh") ? "mesh" : "sphere");
    const bool has_ends = e.has("fromto");
    if (has_ends && type != "capsule" && type != "cylinder" && type != "box")
      e.with("fromto").refuse("fromto: only a capsule, a cylinder and a box have ends");
    double half_length = 0.0;
    if (has_ends) {
      const auto ends = e.numbers("fromto", 6, 6);
      const Eigen::Vector3d from(ends[0], ends[1], ends[2]), to(ends[3], ends[4], ends[5]);
      half_length = 0.5 * (to - from).norm();
      // MuJoCo turns a box's z axis to its start, which decides how its sides lie.
      g.pose = {0.5 * (from + to), along_z(e.with("fromto"), type == "box" ? from - to : to - from)};
    }
    if (type == "sphere") {
      g.radius = e.numbers("size", 1, 3)[0];
    } else if (type == "capsule" || type == "cylinder") {
      const auto size = e.numbers("size", has_ends ? 1 : 2, 3);
      if (!has_ends) half_length = size[1];
      g.radius = size[0];
      g.shape = type == "capsule" ? scene::ShapeKind::kCapsule : scene::ShapeKind::kCylinder;
      g.height = 2.0 * half_length + (type == "capsule" ? 2.0 * g.radius : 0.0);
    } else if (type == "box") {
      g.shape = scene::ShapeKind::kBox;
      auto half = e.numbers("size", has_ends ? 1 : 3, 3);
      if (has_ends) half = {half[0], half[0], half_length};
      g.size = 2.0 * Eigen::Vector3d(half[0], half[1], half[2]);
    } else if (type == "mesh") {
      g.shape = scene::ShapeKind::kSolid;
      const auto mesh = meshes_.find(e.text("mesh", ""));
      if (mesh == meshes_.end())
        e.element().refuse("mesh '" + e.text("mesh", "") + "': there is no such <mesh> in <asset>");
      g.mesh_file = mesh->second.file;
      g.mesh_scale = mesh->second.scale;
    } else {
      e.element().refuse("type='" + type + "': must be sphere, box, cylinder, capsule or mesh");
    }
    g.collides = e.number("contype", 1.0) != 0.0 || e.number("conaffinity", 1.0) != 0.0;
    g.density = e.number("density", kDefaultDensity);
    if (e.has("mass")) g.mass = e.number("mass", 0.0);
    if (e.has("friction")) g.friction = e.numbers("friction", 1, 3)[0];
    const auto material = materials_.find(e.text("material", ""));
    if (e.has("rgba") || material != materials_.end()) {
      const auto rgba = e.has("rgba") ? e.numbers("rgba", 4, 4) : material->second.numbers("rgba", 4, 4);
      const auto part = [&](std::size_t i) { return static_cast<float>(std::clamp(rgba[i], 0.0, 1.0)); };
      g.colour = scene::Colour{part(0), part(1), part(2)};
    }
    return g;
  }

  // As in MuJoCo, a name is unique among the elements of its type; a free joint is a joint.
  void collect_names(const Element& parent) {
    for (const Element& e : parent.children()) {
      const std::string name = e.text("name"), type = e.is("freejoint") ? "joint" : e.tag();
      if (!name.empty() && (type == "body" || type == "geom" || type == "joint") &&
          !names_[type].insert(name).second)
        e.refuse("there is another " + type + " of that name");
      collect_names(e);
    }
  }

  // The element's name, or one that the file gives to no element.
  std::string name_of(const Element& e) {
    std::string name = e.text("name");
    if (!name.empty()) return name;
    int& count = e.is("joint") ? unnamed_joints_ : unnamed_;
    const auto has_it = [&name](const auto& names) { return names.second.contains(name); };
    do name = e.tag() + std::to_string(++count);
    while (std::ranges::any_of(names_, has_it));
    return name;
  }

  // A geom of the world. A plane is the floor, which the table has.
  void add_fixed_geom(const Placed& placed) {
    const Element& e = placed.element;
    const Defaulted geom = defaulted(e, "geom", placed.child_class);
    if (geom.text("type", "sphere") == "plane") return;
    Body& body = model_.bodies.emplace_back();
    body.where = e.where();
    body.names.push_back(name_of(e));
    body.fixed = true;
    Geometry& g = body.geometries.emplace_back(read_geom(geom));
    g.pose = placed.frame * g.pose;
  }

  void add_body(const Element& e, const Pose& parent_pose, int parent, std::string child_class) {
    if (e.has("childclass")) child_class = e.text("childclass");
    if (e.text("mocap") == "true") e.refuse("mocap='true': is not supported");
    const Pose pose = parent_pose * read_pose({e, {}});
    const std::vector<Placed> joints = placed_children(e, "joint", child_class);
    const std::vector<Placed> free = placed_children(e, "freejoint", child_class);
    if (joints.size() + free.size() > 1)
      e.refuse("has " + std::to_string(joints.size() + free.size()) +
               " joints: must have at most one; put bodies between them");
    int index = parent;
    Pose local;
    if (parent < 0 || !joints.empty() || !free.empty()) {
      index = static_cast<int>(model_.bodies.size());
      Body& body = model_.bodies.emplace_back();
      body.where = e.where();
      body.pose = pose;
      body.fixed = joints.empty() && free.empty();
    } else {  // welded to its parent
      local = model_.bodies[parent].pose.to_local(pose);
    }
    Body& body = model_.bodies[index];
    body.names.push_back(name_of(e));
    const std::vector<Placed> geoms = placed_children(e, "geom", child_class);
    const bool replaces_inertial = inertia_from_geom_ == "true" && !geoms.empty();
    const Element inertial = replaces_inertial ? Element(nullptr, nullptr) : e.child("inertial");
    if (inertial) body.inertial = combined(body.inertial, transformed(local, read_inertial(inertial)));
    for (const Placed& geom : geoms) {
      Geometry g = read_geom(defaulted(geom.element, "geom", geom.child_class));
      g.pose = local * geom.frame * g.pose;
      g.has_mass = !inertial && inertia_from_geom_ != "false";
      body.geometries.push_back(std::move(g));
    }
    if (!free.empty() && parent >= 0) free[0].element.refuse("only a body of the world may be free");
    for (const Placed& joint : joints)
      add_joint(defaulted(joint.element, "joint", joint.child_class), pose * joint.frame, index, parent);
    for (const Placed& child : placed_children(e, "body", child_class))
      add_body(child.element, pose * child.frame, index, child.child_class);
  }

  Inertial read_inertial(const Element& e) const {
    Inertial inertial;
    inertial.mass = e.number("mass");
    if (!(inertial.mass > 0.0)) e.refuse("mass: must be greater than 0");
    if (e.has("fullinertia")) {
      const auto i = e.numbers("fullinertia", 6, 6);
      inertial.inertia << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
    } else {
      const auto i = e.numbers("diaginertia", 3, 3);
      inertial.inertia = Eigen::Vector3d(i[0], i[1], i[2]).asDiagonal();
    }
    return transformed(read_pose({e, {}}), inertial);
  }

  void add_joint(const Defaulted& e, const Pose& pose, int body, int parent) {
    const std::string type = e.text("type", "hinge");
    if (type == "free" || type == "ball")
      for (const char* const effort : {"stiffness", "damping", "frictionloss"})
        if (e.number(effort, 0.0) != 0.0)
          e.element().refuse(effort + ("='" + e.text(effort, "")) + "': must be 0 for the type " + type);
    if (type == "free") {
      if (parent >= 0) e.element().refuse("only a body of the world may be free");
      return;
    }
    scene::JointSpec spec;
    if (type == "slide")
      spec.kind = scene::JointKind::kSlider;
    else if (type == "ball")
      spec.kind = scene::JointKind::kBall;
    else if (type != "hinge")
      e.element().refuse("type='" + type + "': must be hinge, slide, ball or free");
    const double unit = type == "hinge" ? angle_unit_ : 1.0;
    spec.a = static_cast<scene::ObjectId>(body);
    if (parent >= 0) spec.b = static_cast<scene::ObjectId>(parent);
    spec.anchor = pose * e.vector("pos", Eigen::Vector3d::Zero());
    const Eigen::Vector3d axis = e.vector("axis", Eigen::Vector3d::UnitZ());
    if (!(axis.norm() > 1e-6)) e.with("axis").refuse("axis: must not be zero");
    spec.axis = pose.orientation * axis.normalized();
    if (e.number("ref", 0.0) != 0.0) e.with("ref").refuse("ref: must be 0");
    const std::string limited = e.text("limited", "auto");
    if (limited == "true" || (limited == "auto" && autolimits_ && e.has("range"))) {
      if (type == "ball") e.element().refuse("range: must be absent for the type ball, or limited='false'");
      const auto range = e.numbers("range", 2, 2);
      if (range[1] < range[0])
        e.with("range").refuse_value("range", "must be the lower limit, then the upper one");
      spec.limits = {range[0] * unit, range[1] * unit};
    }
    spec.friction = e.magnitude("frictionloss");
    const double stiffness = e.magnitude("stiffness"), damping = e.magnitude("damping");
    if (stiffness != 0.0 || damping != 0.0)
      spec.spring = {stiffness, damping, e.number("springref", 0.0) * unit};
    model_.joints.push_back({e.element().where(), name_of(e.element()), spec});
  }

  double angle_unit_ = kDegree;
  std::string euler_sequence_ = "xyz", mesh_folder_, inertia_from_geom_ = "auto";
  bool autolimits_ = true;
  std::map<std::string, DefaultClass> classes_;
  std::map<std::string, Mesh> meshes_;
  std::map<std::string, Element> materials_;
  std::map<std::string, std::set<std::string>> names_;  // of the file, by type
  int unnamed_ = 0, unnamed_joints_ = 0;
  Model model_;
};

}  // namespace

Model read_mjcf(const std::string& text, const std::string& file) {
  const XmlFile xml(text, file, "mujoco");
  return MjcfReader(xml.root()).take();
}

}  // namespace smartsurf::model
