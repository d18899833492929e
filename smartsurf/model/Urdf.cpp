// URDF, the Unified Robot Description Format of ROS: links and joints by name, in metres, kilograms and
// radians.
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "smartsurf/model/Model.h"
#include "smartsurf/model/XmlFile.h"

namespace smartsurf::model {
namespace {

// The attributes of an <origin>, if there is one. rpy: rotations about the fixed axes x, y, z, in this order.
Pose read_origin(const Element& parent) {
  const Element origin = parent.child("origin");
  if (!origin) return {};
  const Eigen::Vector3d rpy = origin.vector("rpy", Eigen::Vector3d::Zero());
  Pose pose;
  pose.position = origin.vector("xyz", Eigen::Vector3d::Zero());
  pose.orientation = Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
  return pose;
}

Inertial read_inertial(const Element& e) {
  Inertial inertial;
  inertial.mass = e.required_child("mass").number("value");
  const Element i = e.required_child("inertia");
  // An Eigen initialiser that an exception leaves asserts.
  const double ixx = i.number("ixx"), iyy = i.number("iyy"), izz = i.number("izz");
  const double ixy = i.number("ixy", 0.0), ixz = i.number("ixz", 0.0), iyz = i.number("iyz", 0.0);
  inertial.inertia << ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz;
  if (!(inertial.mass > 0.0)) e.child("mass").refuse("value: must be greater than 0");
  return transformed(read_origin(e), inertial);
}

// The path after "package://NAME/" or "file://"; the folder of the file stands for the package.
std::string mesh_path(const Element& mesh) {
  std::string path = mesh.required_text("filename");
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  if (path.starts_with(kFile)) return path.substr(kFile.size());
  if (!path.starts_with(kPackage)) return path;
  const std::size_t slash = path.find('/', kPackage.size());
  if (slash == std::string::npos) mesh.refuse("filename='" + path + "': names no file in the package");
  return path.substr(slash + 1);
}

Geometry read_geometry(const Element& e) {
  const Element parent = e.required_child("geometry");
  const std::vector<Element> shapes = parent.children();
  if (shapes.size() != 1) parent.refuse("must contain one of <box>, <cylinder>, <sphere> and <mesh>");
  const Element& shape = shapes.front();
  Geometry g;
  g.where = shape.where();
  g.pose = read_origin(e);
  if (shape.is("box")) {
    g.shape = scene::ShapeKind::kBox;
    shape.required_text("size");
    g.size = shape.vector("size", g.size);
  } else if (shape.is("cylinder")) {
    g.shape = scene::ShapeKind::kCylinder;
    g.radius = shape.number("radius");
    g.height = shape.number("length");
  } else if (shape.is("sphere")) {
    g.radius = shape.number("radius");
  } else if (shape.is("mesh")) {
    g.shape = scene::ShapeKind::kSolid;
    g.mesh_file = mesh_path(shape);
    g.mesh_scale = shape.uniform_scale();
  } else {
    shape.refuse("is unknown: must be <box>, <cylinder>, <sphere> or <mesh>");
  }
  return g;
}

using Colours = std::map<std::string, scene::Colour>;

std::optional<scene::Colour> read_rgba(const Element& material) {
  const Element colour = material.child("color");
  if (!colour) return std::nullopt;
  const std::vector<double> rgba = colour.numbers("rgba", 3, 4);
  for (const double v : rgba)
    if (v < 0.0 || v > 1.0) colour.refuse("rgba='" + colour.text("rgba") + "': must be in [0, 1]");
  return scene::Colour{static_cast<float>(rgba[0]), static_cast<float>(rgba[1]), static_cast<float>(rgba[2])};
}

std::optional<scene::Colour> colour_of(const Element& visual, const Colours& named) {
  const Element material = visual.child("material");
  if (!material) return std::nullopt;
  if (const auto own = read_rgba(material)) return own;
  const auto found = named.find(material.text("name"));
  return found == named.end() ? std::nullopt : std::optional(found->second);
}

struct Link {
  Element element;
  std::vector<std::size_t> child_joints;
  bool has_parent = false;
  std::size_t body = 0;
  Pose pose;
};

// Adds geometries and inertia to the body; `local`: the frame of the link in that of the body.
void add_link(const Element& link, const Pose& local, const Colours& colours, Body& body) {
  std::optional<scene::Colour> colour;
  for (const Element& visual : link.children("visual"))
    if (!colour) colour = colour_of(visual, colours);
  const bool has_collision = static_cast<bool>(link.child("collision"));
  const Element inertial = link.child("inertial");
  for (const Element& e : link.children(has_collision ? "collision" : "visual")) {
    Geometry g = read_geometry(e);
    g.pose = local * g.pose;
    g.colour = colour;
    g.has_mass = !inertial;
    body.geometries.push_back(std::move(g));
  }
  if (inertial) body.inertial = combined(body.inertial, transformed(local, read_inertial(inertial)));
  body.names.push_back(link.required_text("name"));
}

struct JointElement {
  Element element;
  std::size_t parent, child;
};

scene::JointSpec read_joint(const Element& e, const Pose& frame) {
  const std::string type = e.text("type");
  scene::JointSpec spec;
  spec.kind = type == "prismatic" ? scene::JointKind::kSlider : scene::JointKind::kHinge;
  spec.anchor = frame.position;
  const Element axis = e.child("axis");
  const Eigen::Vector3d direction =
      axis ? axis.vector("xyz", Eigen::Vector3d::UnitX()) : Eigen::Vector3d::UnitX();
  if (!(direction.norm() > 1e-6)) axis.refuse("xyz: must not be zero");
  spec.axis = frame.orientation * direction.normalized();
  if (type != "continuous") {
    const Element limit = e.required_child("limit");
    const double lower = limit.number("lower", 0.0), upper = limit.number("upper", 0.0);
    if (upper < lower)
      limit.refuse("upper = " + scene::format_number(upper) +
                   ": must not be below lower = " + scene::format_number(lower));
    spec.limits = {lower, upper};
  }
  if (const Element dynamics = e.child("dynamics")) {
    spec.friction = dynamics.magnitude("friction");
    const double damping = dynamics.magnitude("damping");
    if (damping != 0.0) spec.spring = {0.0, damping, 0.0};
  }
  return spec;
}

class UrdfReader {
 public:
  UrdfReader(const Element& robot, bool fixed_root) : fixed_root_(fixed_root) {
    model_.name = robot.text("name");
    for (const Element& material : robot.children("material"))
      if (const auto colour = read_rgba(material)) colours_.emplace(material.text("name"), *colour);
    for (const Element& e : robot.children("link")) {
      if (!link_index_.emplace(e.required_text("name"), links_.size()).second)
        e.refuse("there is another link of that name");
      links_.push_back({e, {}, false, 0, {}});
    }
    for (const Element& e : robot.children("joint")) read_joint_links(e);
    build(robot);
  }
  Model take() { return std::move(model_); }

 private:
  std::size_t link_of(const Element& joint, const char* tag) const {
    const Element e = joint.required_child(tag);
    const auto found = link_index_.find(e.required_text("link"));
    if (found == link_index_.end())
      joint.refuse(std::string(tag) + " '" + e.text("link") + "': there is no such link");
    return found->second;
  }

  void read_joint_links(const Element& e) {
    const std::string name = e.required_text("name"), type = e.required_text("type");
    if (!joint_names_.emplace(name, 0).second) e.refuse("there is another joint of that name");
    constexpr std::string_view kTypes[] = {"fixed", "revolute", "continuous", "prismatic", "floating"};
    if (std::ranges::find(kTypes, type) == std::end(kTypes))
      e.refuse("type='" + type + "': must be fixed, revolute, continuous, prismatic or floating");
    if (e.child("mimic")) e.refuse("<mimic>: joints that follow others are not supported");
    const std::size_t parent = link_of(e, "parent"), child = link_of(e, "child");
    if (links_[child].has_parent)
      e.refuse("the link '" + e.child("child").text("link") + "' has two parents");
    links_[child].has_parent = true;
    links_[parent].child_joints.push_back(joints_.size());
    joints_.push_back({e, parent, child});
  }

  // Builds the links from the root outwards.
  void build(const Element& robot) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (!links_[i].has_parent) order.push_back(i);
    if (order.size() != 1)
      robot.refuse("has " + std::to_string(order.size()) + " links without a parent: must be one, the root");
    const Element& root = links_[order[0]].element;
    start_body(links_[order[0]], fixed_root_ || root.text("name") == "world");
    for (std::size_t k = 0; k < order.size(); ++k)
      for (const std::size_t j : links_[order[k]].child_joints) {
        attach(joints_[j]);
        order.push_back(joints_[j].child);
      }
    if (order.size() != links_.size()) robot.refuse("some links are their own ancestors");
  }

  void start_body(Link& link, bool fixed) {
    link.body = model_.bodies.size();
    Body& body = model_.bodies.emplace_back();
    body.where = link.element.where();
    body.pose = link.pose;
    body.fixed = fixed;
    add_link(link.element, {}, colours_, body);
  }

  void attach(const JointElement& joint) {
    Link &parent = links_[joint.parent], &child = links_[joint.child];
    child.pose = parent.pose * read_origin(joint.element);
    const std::string type = joint.element.text("type");
    if (type == "fixed") {
      child.body = parent.body;
      Body& body = model_.bodies[parent.body];
      return add_link(child.element, body.pose.to_local(child.pose), colours_, body);
    }
    start_body(child, false);
    if (type == "floating") return;
    scene::JointSpec spec = read_joint(joint.element, child.pose);
    spec.a = static_cast<scene::ObjectId>(child.body);
    spec.b = static_cast<scene::ObjectId>(parent.body);
    model_.joints.push_back({joint.element.where(), joint.element.text("name"), spec});
  }

  bool fixed_root_;
  Colours colours_;
  std::vector<Link> links_;
  std::vector<JointElement> joints_;
  std::map<std::string, std::size_t> link_index_, joint_names_;
  Model model_;
};

}  // namespace

Model read_urdf(const std::string& text, const std::string& file, bool fixed_root) {
  const XmlFile xml(text, file, "robot");
  return UrdfReader(xml.root(), fixed_root).take();
}

}  // namespace smartsurf::model
