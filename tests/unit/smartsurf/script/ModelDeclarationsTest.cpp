// urdf{} and mjcf{}: what becomes of the files, their units, and the messages of broken ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "smartsurf/mesh/SolidLibrary.h"
#include "tests/unit/smartsurf/script/ScriptFixture.h"

namespace smartsurf::script {
namespace {

using Eigen::Vector3d;
using scene::JointKind;
using scene::ShapeKind;

class ModelsTest : public ScriptTest {
 protected:
  void SetUp() override {
    ScriptTest::SetUp();
    options.solid_factory = std::make_shared<mesh::SolidLibrary>();
  }
  // The scene of one urdf{} or mjcf{} with the fields after `file`, and its printed ids.
  scene::SceneSpec scene_of(const std::string& call, const std::string& text,
                            const std::string& fields = "position = {0, 0, 0}",
                            const std::string& before = "") {
    write("m.xml", text);
    return load_on_surface(before + "m = " + call + "{file = 'm.xml', " + fields + "}").scene();
  }
  std::string urdf_error(const std::string& content) {
    write("m.xml", "<robot name='r'>\n" + content + "\n</robot>");
    return error_of("surface{}\nurdf{file = 'm.xml', position = {0, 0, 0}}");
  }
  std::string mjcf_error(const std::string& content) {
    write("m.xml", "<mujoco>\n" + content + "\n</mujoco>");
    return error_of("surface{}\nmjcf{file = 'm.xml', position = {0, 0, 0}}");
  }
};

constexpr const char* kLink =
    "<link name='a'><inertial><origin xyz='0.1 0.2 0.3' rpy='0 0 1.5707963267948966'/><mass value='2'/>"
    "<inertia ixx='1' iyy='2' izz='2.5' ixy='0' ixz='0' iyz='0'/></inertial>"
    "<collision><origin xyz='0.1 0 0'/><geometry><box size='1 2 3'/></geometry></collision>"
    "<visual><geometry><sphere radius='9'/></geometry><material name='m'><color rgba='1 0.5 0 1'/></material>"
    "</visual></link>";

// A link of one geometry is its shape, whose origin is the geometry's.
TEST_F(ModelsTest, UrdfLinkIsItsCollisionShape) {
  const scene::SceneSpec spec =
      scene_of("urdf", "<robot name='r'>" + std::string(kLink) + "</robot>", "position = {5, 6, 7}");
  ASSERT_EQ(spec.objects.size(), 1U);
  const scene::ObjectSpec& o = spec.objects[0];
  EXPECT_EQ(o.shape, ShapeKind::kBox);
  EXPECT_EQ(o.size, Vector3d(1, 2, 3));
  EXPECT_EQ(o.label, "a");
  EXPECT_FLOAT_EQ(o.colour.g, 0.5F);
  EXPECT_EQ(o.mass, 2.0);
  EXPECT_LT((o.position - Vector3d(5.1, 6, 7)).norm(), 1e-12);
  EXPECT_LT((o.centre_of_mass - Vector3d(0, 0.2, 0.3)).norm(), 1e-12);
  ASSERT_TRUE(o.inertia);  // turned by a right angle about z
  EXPECT_LT((*o.inertia - Eigen::Matrix3d(Vector3d(2, 1, 2.5).asDiagonal())).norm(), 1e-12);
}

// Links that are welded together are one object with the sum of their masses and inertias.
TEST_F(ModelsTest, UrdfFixedJointsWeldLinks) {
  const auto ball = [](const std::string& name) {
    return "<link name='" + name +
           "'><inertial><mass value='1'/><inertia ixx='0.1' iyy='0.1' izz='0.1'/></inertial>"
           "<collision><geometry><sphere radius='0.5'/></geometry></collision></link>";
  };
  const scene::SceneSpec spec = scene_of(
      "urdf", "<robot name='r'>" + ball("a") + ball("b") +
                  "<joint name='j' type='fixed'><origin xyz='2 0 0'/><parent link='a'/><child link='b'/>"
                  "</joint></robot>");
  ASSERT_EQ(spec.objects.size(), 1U);
  EXPECT_TRUE(spec.joints.empty());
  const scene::ObjectSpec& o = spec.objects[0];
  EXPECT_EQ(o.shape, ShapeKind::kSolid);
  EXPECT_EQ(o.solid->hulls.size(), 2U);
  EXPECT_NEAR(o.position.x(), 1.0, 1e-6);
  EXPECT_EQ(o.mass, 2.0);
  EXPECT_LT((*o.inertia - Eigen::Matrix3d(Vector3d(0.2, 2.2, 2.2).asDiagonal())).norm(), 1e-5);
  EXPECT_NEAR(o.solid->volume, 2 * M_PI / 6, 0.05 * 2 * M_PI / 6);
}

TEST_F(ModelsTest, UrdfJoints) {
  const std::string arm =
      "<link name='world'/>" + std::string(kLink) +
      "<joint name='hinge' type='revolute'><origin xyz='0 0 1' rpy='0 0 1.5707963267948966'/>"
      "<parent link='world'/><child link='a'/><axis xyz='2 0 0'/>"
      "<limit lower='-1' upper='2' effort='5' velocity='1'/><dynamics damping='3' friction='4'/></joint>"
      "<link name='b'><collision><geometry><cylinder radius='0.1' length='0.4'/></geometry></collision>"
      "</link><joint name='slide' type='prismatic'><origin xyz='0 0 1'/><parent link='a'/>"
      "<child link='b'/><axis xyz='0 0 1'/><limit lower='0' upper='0.5'/></joint>";
  const scene::SceneSpec spec = scene_of("urdf", "<robot name='r'>" + arm + "</robot>",
                                         "position = {3, 0, 0}, unit = 'm'", "world{unit = 'cm'}\n");
  ASSERT_EQ(spec.joints.size(), 2U);
  const scene::JointSpec &hinge = spec.joints[0], &slide = spec.joints[1];
  EXPECT_EQ(hinge.kind, JointKind::kHinge);
  EXPECT_EQ(hinge.a, 0U);
  EXPECT_FALSE(hinge.b);  // the link 'world' is the table
  EXPECT_LT((hinge.anchor - Vector3d(3, 0, 100)).norm(), 1e-9);
  EXPECT_LT((hinge.axis - Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_EQ(hinge.limits->lower, -1.0);
  EXPECT_EQ(hinge.limits->upper, 2.0);
  EXPECT_NEAR(hinge.friction, 4e4, 1e-6);  // N·m in kg·cm²/s²
  EXPECT_NEAR(hinge.spring->damping, 3e4, 1e-6);
  EXPECT_EQ(slide.kind, JointKind::kSlider);
  EXPECT_EQ(slide.b, 0U);
  EXPECT_NEAR(slide.limits->upper, 50.0, 1e-9);
  EXPECT_NEAR(spec.objects[1].radius, 10.0, 1e-9);
  EXPECT_NEAR(*spec.objects[1].mass, M_PI * 100 * 40, 1e-6);  // the material's density
}

TEST_F(ModelsTest, MjcfBodiesGeomsAndJoints) {
  const scene::SceneSpec spec = scene_of("mjcf", R"(<mujoco model='m'>
    <compiler angle='radian'/>
    <default><geom density='2'/><joint damping='0.5'/>
      <default class='heavy'><geom density='10' rgba='0 0 1 1'/></default></default>
    <worldbody>
      <geom type='plane' size='1 1 1'/>
      <geom name='wall' type='box' size='1 2 3' pos='9 0 0'/>
      <body name='top' pos='0 0 4' euler='0 0 1.5707963267948966'>
        <joint type='hinge' axis='1 0 0' pos='0 1 0' range='-1 1' stiffness='7' springref='0.5' frictionloss='0.2'/>
        <geom type='sphere' size='0.5' class='heavy'/>
        <body name='tip' pos='0 0 1' childclass='heavy'>
          <joint name='ball' type='ball' damping='0'/>
          <geom type='capsule' fromto='0 0 0 0 2 0' size='0.1'/>
        </body>
      </body>
      <body pos='0 5 1'><freejoint/><geom type='cylinder' size='0.5 0.25' mass='3' friction='0.9 0 0'/></body>
    </worldbody></mujoco>)");
  ASSERT_EQ(spec.objects.size(), 4U);
  EXPECT_TRUE(spec.objects[0].fixed);
  EXPECT_EQ(spec.objects[0].size, Vector3d(2, 4, 6));
  const scene::ObjectSpec& top = spec.objects[1];
  EXPECT_NEAR(*top.mass, 10 * M_PI / 6, 1e-9);
  EXPECT_FLOAT_EQ(top.colour.b, 1.0F);
  const scene::ObjectSpec& tip = spec.objects[2];
  EXPECT_EQ(tip.shape, ShapeKind::kCapsule);
  EXPECT_NEAR(tip.height, 2.2, 1e-12);
  EXPECT_LT((tip.position - Vector3d(-1, 0, 5)).norm(), 1e-9);
  EXPECT_LT((tip.orientation * Vector3d::UnitZ() - Vector3d(-1, 0, 0)).norm(), 1e-9);
  EXPECT_EQ(spec.objects[3].mass, 3.0);
  EXPECT_EQ(spec.objects[3].friction, 0.9);
  EXPECT_EQ(spec.objects[3].height, 0.5);
  ASSERT_EQ(spec.joints.size(), 2U);
  const scene::JointSpec &hinge = spec.joints[0], &ball = spec.joints[1];
  EXPECT_FALSE(hinge.b);
  EXPECT_LT((hinge.anchor - Vector3d(-1, 0, 4)).norm(), 1e-9);
  EXPECT_LT((hinge.axis - Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_EQ(hinge.limits->upper, 1.0);
  EXPECT_EQ(hinge.spring->stiffness, 7.0);
  EXPECT_EQ(hinge.spring->damping, 0.5);
  EXPECT_EQ(hinge.spring->rest, 0.5);
  EXPECT_EQ(hinge.friction, 0.2);
  EXPECT_EQ(ball.kind, JointKind::kBall);
  EXPECT_EQ(ball.b, 1U);
}

// Degrees are the default; limits do not count if `limited` says so.
TEST_F(ModelsTest, MjcfAnglesAreDegrees) {
  const scene::SceneSpec spec =
      scene_of("mjcf",
               "<mujoco><worldbody><body euler='0 90 0'><joint range='0 180'/><geom size='1'/></body>"
               "<body pos='9 0 0'><joint range='0 90' limited='false'/><geom size='1'/></body>"
               "</worldbody></mujoco>");
  EXPECT_NEAR(spec.joints[0].limits->upper, M_PI, 1e-12);
  EXPECT_LT((spec.joints[0].axis - Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_FALSE(spec.joints[1].limits);
}

// As in MuJoCo: sections of defaults are merged, the attributes of later ones replace those of earlier ones.
TEST_F(ModelsTest, MjcfDefaultsAreMerged) {
  const scene::SceneSpec spec =
      scene_of("mjcf",
               "<mujoco><default><geom type='box' size='1 1 1' density='7'/></default>"
               "<default><geom density='2'/></default>"
               "<default><default class='c'><geom size='2 2 2'/></default></default>"
               "<worldbody><body><freejoint/><geom/></body>"
               "<body pos='9 0 0' childclass='c'><freejoint/><geom/></body></worldbody></mujoco>");
  EXPECT_NEAR(*spec.objects[0].mass, 2.0 * 8, 1e-9);
  EXPECT_NEAR(*spec.objects[1].mass, 2.0 * 64, 1e-9);
}

// The numbers are MuJoCo's.
TEST_F(ModelsTest, MjcfBoxesWithEndsHaveSquareSections) {
  const scene::SceneSpec spec =
      scene_of("mjcf",
               "<mujoco><default><default class='c'><geom size='3 1 1'/></default></default><worldbody>"
               "<geom type='box' size='1 2' fromto='0 0 0 0 0 4'/>"
               "<geom type='box' class='c' fromto='0 0 0 2 1 3'/></worldbody></mujoco>");
  ASSERT_EQ(spec.objects.size(), 2U);
  EXPECT_LT((spec.objects[0].size - Vector3d(2, 2, 4)).norm(), 1e-9);
  EXPECT_NEAR(std::abs(spec.objects[0].orientation.x()), 1.0, 1e-9);
  EXPECT_LT((spec.objects[1].size - Vector3d(6, 6, std::sqrt(14.0))).norm(), 1e-9);
  const Eigen::Quaterniond mujoco(0.31481445, 0.42447423, -0.84894846, 0.0);
  EXPECT_LT(spec.objects[1].orientation.angularDistance(mujoco), 1e-6);
}

// An orientation takes the place of an inherited one, in any of the notations.
TEST_F(ModelsTest, MjcfOwnOrientationReplacesThatOfTheDefaults) {
  const std::string notations[] = {"quat='0.6 0.8 0 0'", "axisangle='0 1 0 40'", "euler='0 20 70'",
                                   "xyaxes='0 1 0 0 0 1'", "zaxis='1 0 0'"};
  const auto orientation = [&](const std::string& outer, const std::string& inner, const std::string& own) {
    return scene_of("mjcf", "<mujoco><default><geom type='box' size='1 2 3' " + outer +
                                "/><default class='c'><geom " + inner + "/></default></default><worldbody>" +
                                "<geom class='c' " + own + "/></worldbody></mujoco>")
        .objects[0]
        .orientation;
  };
  for (const std::string& notation : notations)
    for (const std::string& other : notations) {
      const Eigen::Quaterniond alone = orientation("", "", notation);
      EXPECT_EQ(orientation(other, "", notation).coeffs(), alone.coeffs()) << other << ", " << notation;
      EXPECT_EQ(orientation(other, notation, "").coeffs(), alone.coeffs()) << other << ", " << notation;
    }
}

TEST_F(ModelsTest, MjcfLaterCompilersReplaceTheAttributesOfEarlierOnes) {
  const auto load = [&](const std::string& compilers) {
    return scene_of("mjcf",
                    "<mujoco>" + compilers +
                        "<worldbody><body><inertial pos='0 0 0' mass='2' diaginertia='1 1 1'/>"
                        "<joint range='0 180'/><geom type='box' size='1 2 3' euler='10 20 30'/></body>"
                        "</worldbody></mujoco>");
  };
  const scene::SceneSpec
      plain = load(""),
      back = load(
          "<compiler angle='radian' eulerseq='zyx' autolimits='false' inertiafromgeom='true'/>"
          "<compiler/><compiler angle='degree' eulerseq='xyz'/>"
          "<compiler autolimits='true' inertiafromgeom='auto'/>");
  EXPECT_EQ(back.objects[0].orientation.coeffs(), plain.objects[0].orientation.coeffs());
  EXPECT_EQ(back.objects[0].mass, 2.0);
  ASSERT_TRUE(back.joints[0].limits);
  EXPECT_EQ(back.joints[0].limits->upper, plain.joints[0].limits->upper);
}

// Names are unique among the elements of a type.
TEST_F(ModelsTest, MjcfGeomsAndBodiesMayHaveTheSameName) {
  write("m.xml",
        "<mujoco><worldbody><body name='x'><freejoint name='x'/><geom size='1'/></body></worldbody>"
        "<worldbody><geom name='x' size='1'/><geom size='1'/></worldbody></mujoco>");
  load_on_surface("print(mjcf{file = 'm.xml', position = {0, 0, 0}}.objects.x)");
  EXPECT_EQ(printed, "2\n");
}

// Whichever elements the file names, also as the importer would, every object and joint has its own name.
TEST_F(ModelsTest, MjcfElementsWithoutANameGetOneThatIsNotTheFiles) {
  constexpr int kCount = 6;  // of geoms, bodies and joints
  for (unsigned seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto names_from = [&](const std::vector<std::string>& types, std::size_t count) {
      std::vector<std::string> names(2 * count);
      for (std::size_t i = 0; i < names.size(); ++i)
        names[i] = types[i % types.size()] + std::to_string(1 + i / types.size());
      std::ranges::shuffle(names, random);
      names.resize(count);
      for (std::string& name : names)
        if (random() % 2 == 0) name.clear();
      return names;
    };
    const std::vector<std::string> objects = names_from({"geom", "body"}, 2 * kCount),
                                   joints = names_from({"joint"}, kCount);
    const auto attribute = [](const std::string& name) { return name.empty() ? "" : " name='" + name + "'"; };
    std::string geoms, bodies;
    for (int k = 0; k < kCount; ++k) {
      geoms += "<geom size='1'" + attribute(objects[k]) + "/>";
      bodies += "<body" + attribute(objects[kCount + k]) + "><joint" + attribute(joints[k]) +
                "/><geom size='1'/></body>";
    }
    write("m.xml", "<mujoco><worldbody>" + geoms + bodies + "</worldbody></mujoco>");
    printed.clear();
    load_on_surface(
        "local m = mjcf{file = 'm.xml', position = {0, 0, 0}}\n"
        "for _, ids in ipairs{m.objects, m.joints} do\n"
        "for name, id in pairs(ids) do print(id, name) end print(-1, 'end') end");
    std::istringstream lines(printed);
    for (const std::vector<std::string>& given : {objects, joints}) {
      std::vector<std::string> found(given.size());
      std::string name;
      for (int id; lines >> id >> name && id >= 0;) found.at(id) = name;
      for (std::size_t id = 0; id < given.size(); ++id)
        EXPECT_TRUE(!found[id].empty() && (given[id].empty() || found[id] == given[id])) << id << found[id];
    }
  }
}

// The numbers are MuJoCo's.
TEST_F(ModelsTest, MjcfFramesPlaceTheirChildren) {
  const scene::SceneSpec spec = scene_of("mjcf", R"(<mujoco>
    <default><default class='heavy'><geom density='2'/></default></default>
    <worldbody>
      <frame pos='1 2 3' euler='0 0 90'>
        <geom type='box' size='1 2 3' pos='4 0 0'/>
        <body pos='1 0 0'>
          <frame pos='0 0 1' euler='90 0 0' childclass='heavy'>
            <joint axis='0 0 1' pos='0 1 0'/>
            <frame><geom type='box' size='1 1 1' pos='1 0 0'/></frame>
          </frame>
        </body>
      </frame>
    </worldbody></mujoco>)");
  ASSERT_EQ(spec.objects.size(), 2U);
  const scene::ObjectSpec &wall = spec.objects[0], &body = spec.objects[1];
  EXPECT_TRUE(wall.fixed);
  EXPECT_LT((wall.position - Vector3d(1, 6, 3)).norm(), 1e-9);
  EXPECT_LT((wall.orientation * Vector3d::UnitX() - Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_LT((body.position - Vector3d(1, 4, 4)).norm(), 1e-9);
  EXPECT_LT((body.orientation * Vector3d::UnitY() - Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_NEAR(*body.mass, 2.0 * 8, 1e-9);
  ASSERT_EQ(spec.joints.size(), 1U);
  EXPECT_LT((spec.joints[0].anchor - Vector3d(1, 3, 5)).norm(), 1e-9);
  EXPECT_LT((spec.joints[0].axis - Vector3d(1, 0, 0)).norm(), 1e-9);
}

// As MuJoCo does. A body without a mass may be welded to one that has it, or be fixed.
TEST_F(ModelsTest, MjcfInertiaIsTheGeomsOrTheInertials) {
  const std::string body =
      "<body pos='9 0 0'><freejoint/><inertial pos='0 0 0' mass='2' diaginertia='1 1 1'/>"
      "<geom size='1' mass='5'/><body><geom size='1' pos='1 0 0' mass='7'/></body></body>";
  for (const auto& [source, mass] : {std::pair{"true", 12.0}, {"auto", 9.0}, {"false", 2.0}}) {
    const scene::SceneSpec spec =
        scene_of("mjcf", "<mujoco><compiler inertiafromgeom='" + std::string(source) +
                             "'/><worldbody><body><geom size='1'/></body>" + body + "</worldbody></mujoco>");
    ASSERT_EQ(spec.objects.size(), 2U) << source;
    EXPECT_TRUE(spec.objects[0].fixed);
    EXPECT_EQ(spec.objects[1].mass, mass) << source;
  }
  const scene::SceneSpec without_geoms = scene_of(
      "mjcf",
      "<mujoco><compiler inertiafromgeom='true'/><worldbody><body><freejoint/><geom size='1' mass='5'/>"
      "<body><inertial pos='0 0 0' mass='2' diaginertia='1 1 1'/></body></body></worldbody></mujoco>");
  EXPECT_EQ(without_geoms.objects[0].mass, 7.0);
}

TEST_F(ModelsTest, ReturnsIdsByName) {
  write("m.xml",
        "<mujoco><worldbody><body name='p'><joint name='j'/><geom size='1'/>"
        "<body name='q'><geom size='1' pos='3 0 0'/></body></body></worldbody></mujoco>");
  load_on_surface(
      "sphere{radius = 1, position = {0, 0, 9}}\nlocal m = mjcf{file = 'm.xml', position = {0, 0, 0}}\n"
      "print(m.objects.p, m.objects.q, m.joints.j)");
  EXPECT_EQ(printed, "1\t1\t0\n");
}

TEST_F(ModelsTest, FilesErrorsNameLineAndElement) {
  const std::string link =
      "<link name='l'><collision><geometry><sphere radius='1'/></geometry></collision></link>";
  for (const auto& [content, expected] : std::vector<std::pair<std::string, std::string>>{
           {"<link/>", "2: <link>: the attribute 'name' is missing"},
           {"<link name='l'>", "2: is not well-formed XML (XML_ERROR_MISMATCHED_ELEMENT)"},
           {"<link name='l'><collision/></link>", "2: <collision>: the element <geometry> is missing"},
           {"<link name='l'><collision><geometry><cone/></geometry></collision></link>",
            "2: <cone>: is unknown: must be <box>, <cylinder>, <sphere> or <mesh>"},
           {"<link name='l'><collision><geometry><box size='1 2'/></geometry></collision></link>",
            "2: <box>: size='1 2': must be 3 numbers"},
           {"<link name='l'><collision><geometry><sphere radius='-1'/></geometry></collision></link>",
            "2: <sphere>: radius = -1: must be in [0.001, 1000000]"},
           {"<link name='l'><collision><geometry><sphere radius='nan'/></geometry></collision></link>",
            "2: <sphere>: radius='nan': must be a number"},
           {"<link name='l'/>",
            "2: <link name='l'>: has no geometry: give it a shape, or weld it to another body"},
           {link + link, "2: <link name='l'>: there is another link of that name"},
           {link + "\n<joint name='j' type='fixed'><parent link='l'/><child link='m'/></joint>",
            "3: <joint name='j'>: child 'm': there is no such link"},
           {link + "<joint name='j' type='planar'/>",
            "2: <joint name='j'>: type='planar': must be fixed, revolute, continuous, prismatic or floating"},
           {link + "<joint name='j' type='fixed'><parent link='l'/><child link='l'/></joint>",
            "1: <robot name='r'>: has 0 links without a parent: must be one, the root"},
           {link + "<link name='m'/><joint name='j' type='revolute'><parent link='l'/><child link='m'/>\n"
                   "<limit upper='-2'/></joint>",
            "3: <limit>: upper = -2: must not be below lower = 0"},
           {link + "<link name='m'/><joint name='j' type='continuous'><parent link='l'/><child link='m'/>\n"
                   "<dynamics damping='-2'/></joint>",
            "3: <dynamics>: damping='-2': must not be below 0"},
           {"<link name='l'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='9'/></inertial>"
            "<collision><geometry><sphere radius='1'/></geometry></collision></link>",
            "2: <link name='l'>: inertia, whose greatest principal moment = 9: must be at most the sum of "
            "the others, "
            "2"},
           {"<link name='l'><inertial><mass value='1'/><inertia ixx='1'/></inertial></link>",
            "2: <inertia>: the attribute 'iyy' is missing"},
           {"<link name='l'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='x'/></inertial></link>",
            "2: <inertia>: izz='x': must be a number"},
           {"<link name='l'><collision><geometry><mesh "
            "filename='../../x.stl'/></geometry></collision></link>",
            "2: <mesh>: '../../x.stl' is outside the script's folder and the output folder; --unsafe allows "
            "it"},
           {"<link name='l'><collision><geometry><mesh "
            "filename='package://p/x.stl'/></geometry></collision></link>",
            "2: <mesh>: 'x.stl': does not exist"}})
    EXPECT_EQ(urdf_error(content), "t.lua:2: m.xml:" + expected);
  for (const auto& [content, expected] : std::vector<std::pair<std::string, std::string>>{
           {"<worldbody><body><geom type='ellipsoid' size='1 1 1'/></body></worldbody>",
            "2: <geom>: type='ellipsoid': must be sphere, box, cylinder, capsule or mesh"},
           {"<worldbody><body><joint/><joint/><geom size='1'/></body></worldbody>",
            "2: <body>: has 2 joints: must have at most one; put bodies between them"},
           {"<worldbody><body><geom class='x' size='1'/></body></worldbody>",
            "2: <geom>: class 'x': there is no such class of defaults"},
           {"<default class='a'><default class='a'/></default>"
            "<worldbody><body childclass='a'>\n<freejoint/><geom size='1'/></body></worldbody>",
            "3: <geom>: its class is its own ancestor"},
           {"<default><geom size='1'/>\n<geom size='2'/></default>",
            "3: <geom>: is found twice in a <default>: must be there once"},
           {"<worldbody><body>\n<replicate count='2'><geom size='1'/></replicate></body></worldbody>",
            "3: <replicate>: is not read: write the elements that it stands for into the file"},
           {"<worldbody>\n<include file='a.xml'/></worldbody>",
            "3: <include>: is not read: write the elements that it stands for into the file"},
           {"<worldbody><body><frame>\n<inertial mass='1'/></frame></body></worldbody>",
            "3: <inertial>: is in a <frame>: must be in the body itself"},
           {"<compiler inertiafromgeom='maybe'/>",
            "2: <compiler>: inertiafromgeom='maybe': must be false, true or auto"},
           {"<compiler inertiafromgeom='false'/><worldbody>\n<body name='b'><freejoint/>"
            "<geom size='1' mass='3'/></body></worldbody>",
            "3: <body name='b'>: has no mass: give it an <inertial>, or leave out inertiafromgeom='false'"},
           {"<equality>\n<weld/></equality>",
            "2: <equality>: is not supported: only joints constrain the bodies"},
           {"<worldbody><body><joint type='ball' range='0 1'/><geom size='1'/></body></worldbody>",
            "2: <joint>: range: must be absent for the type ball, or limited='false'"},
           {"<default><joint damping='0.5'/></default><worldbody><body>\n<joint type='ball'/><geom size='1'/>"
            "</body></worldbody>",
            "3: <joint>: damping='0.5': must be 0 for the type ball"},
           {"<worldbody><body><joint type='ball' stiffness='2'/><geom size='1'/></body></worldbody>",
            "2: <joint>: stiffness='2': must be 0 for the type ball"},
           {"<worldbody><body><joint type='free' frictionloss='2'/><geom size='1'/></body></worldbody>",
            "2: <joint>: frictionloss='2': must be 0 for the type free"},
           {"<compiler autolimits='no'/>", "2: <compiler>: autolimits='no': must be false or true"},
           {"<worldbody><body><geom size='1' quat='1 0 0 0' euler='1 2 3'/></body></worldbody>",
            "2: <geom>: has several orientations: must be one of quat, axisangle, euler, zaxis and xyaxes"},
           {"<worldbody><geom name='a' size='1'/>\n<geom name='a' size='1'/></worldbody>",
            "3: <geom name='a'>: there is another geom of that name"},
           {"<worldbody><body><joint name='a'/><geom size='1'/></body><body>\n<freejoint name='a'/>"
            "<geom size='1'/></body></worldbody>",
            "3: <freejoint name='a'>: there is another joint of that name"},
           {"<worldbody><geom type='plane'/></worldbody>", "1: <mujoco>: has no bodies"},
           {"<worldbody><body><joint range='90 0'/><geom size='1'/></body></worldbody>",
            "2: <joint>: range='90 0': must be the lower limit, then the upper one"},
           {"<default><joint stiffness='-3'/></default><worldbody><body>\n<joint/><geom size='1'/></body>"
            "</worldbody>",
            "2: <joint>: stiffness='-3': must not be below 0"},
           {"<worldbody><body><joint damping='-1'/><geom size='1'/></body></worldbody>",
            "2: <joint>: damping='-1': must not be below 0"},
           {"<worldbody><body><joint frictionloss='-1'/><geom size='1'/></body></worldbody>",
            "2: <joint>: frictionloss='-1': must not be below 0"}})
    EXPECT_EQ(mjcf_error(content), "t.lua:2: m.xml:" + expected);
  write("m.xml", "<mujoco/>");
  EXPECT_EQ(error_of("surface{}\nurdf{file = 'm.xml', position = {0, 0, 0}}"),
            "t.lua:2: m.xml:1: the first element must be <robot>");
  EXPECT_EQ(error_of("surface{}\nmjcf{file = 'm.xml', position = {0, 0, 0}}"),
            "t.lua:2: m.xml:1: <mujoco>: has no bodies");
  EXPECT_EQ(error_of("surface{}\nurdf{file = 'n.xml', position = {0, 0, 0}}"),
            "t.lua:2: urdf.file: 'n.xml' does not exist");
}

// Messages show the first 100 characters.
TEST_F(ModelsTest, NamesAreComparedAsAWhole) {
  const auto bodies = [](std::size_t length, const std::string& ends) {
    std::string text;
    for (const char end : ends)
      text += "<body name='" + std::string(length, 'n') + end + "' pos='" + end +
              " 0 0'><freejoint/><geom size='1'/></body>";
    return "<worldbody>" + text + "</worldbody>";
  };
  const scene::SceneSpec spec = scene_of("mjcf", "<mujoco>" + bodies(99, "19") + "</mujoco>");
  ASSERT_EQ(spec.objects.size(), 2U);
  EXPECT_EQ(spec.objects[1].label, std::string(99, 'n') + "9");
  EXPECT_EQ(mjcf_error(bodies(120, "11")), "t.lua:2: m.xml:2: <body name='" + std::string(100, 'n') +
                                               "'>: there is another body of that name");
}

TEST_F(ModelsTest, NamesAreLabels) {
  const std::string rule = "'>: the name must be at most 100 bytes in one line";
  const std::string long_name(100, 'n'), umlauts = std::string(99, 'n') + "\u00e4";
  const std::string shape = "'><collision><geometry><sphere radius='1'/></geometry></collision></link>";
  for (const std::string& name : {long_name + "1", umlauts})
    EXPECT_EQ(urdf_error("<link name='" + name + shape),
              "t.lua:2: m.xml:2: <link name='" + name.substr(0, 100) + rule);
  EXPECT_TRUE(urdf_error("<link name='a\x7f" + shape).ends_with(rule));
  EXPECT_TRUE(
      mjcf_error("<worldbody><body name='a\x7f'><geom size='1'/></body></worldbody>").ends_with(rule));
}

// Deep, long and cut files end in one line.
TEST_F(ModelsTest, HostileFilesAreRefused) {
  std::string deep, many;
  for (int i = 0; i < 5000; ++i) deep += "<body>";
  for (int i = 0; i < 100'001; ++i) many += "<x/>";
  EXPECT_EQ(mjcf_error(deep), "t.lua:2: m.xml:2: elements are nested deeper than 100");
  EXPECT_EQ(mjcf_error(many), "t.lua:2: m.xml:1: has more than 100000 elements");
  std::string wide = "<body";  // each attribute is compared with all before it
  for (int i = 0; i < 1001; ++i) wide += " a" + std::to_string(i) + "='<!-- \"'";
  EXPECT_EQ(mjcf_error(wide + "/>"), "t.lua:2: m.xml:2: an element has more than 1000 attributes");
  const std::string whole = "<robot name='r'>" + std::string(kLink) + "</robot>";
  for (std::size_t length = 0; length < whole.size(); length += 7) {
    write("m.xml", whole.substr(0, length));
    EXPECT_NE(error_of("surface{}\nurdf{file = 'm.xml', position = {0, 0, 0}}"), "") << length;
  }
}

TEST_F(ModelsTest, ObjectsHaveCentreOfMassAndInertia) {
  const scene::SceneSpec spec = load_on_surface(
                                    "sphere{radius = 1, position = {0, 0, 9}, com = {0, 0, -0.5}, inertia = "
                                    "{2, 2.5, 3, 0.1, 0.2, 0.3}}")
                                    .scene();
  EXPECT_EQ(spec.objects[0].centre_of_mass, Vector3d(0, 0, -0.5));
  EXPECT_EQ((*spec.objects[0].inertia)(0, 2), 0.2);
  EXPECT_EQ(error_of("sphere{radius = 1, position = {0, 0, 0}, inertia = {1, 1}}"),
            "t.lua:1: sphere.inertia = a table of 2 values: must be {ixx, iyy, izz} or {ixx, iyy, izz, ixy, "
            "ixz, iyz}");
  EXPECT_EQ(error_of("sphere{radius = 1, position = {0, 0, 0}, inertia = {1, 1, -1}}"),
            "t.lua:1: sphere.inertia, whose least principal moment = -1: must be in [1e-15, 1e+24], as must "
            "the greatest, 1");
  EXPECT_EQ(error_of("sphere{radius = 1, position = {0, 0, 0}, com = {0, 0, 1e9}}"),
            "t.lua:1: sphere.com[3] = 1000000000: must be in [-1000000, 1000000]");
}

}  // namespace
}  // namespace smartsurf::script
