// Tests joint{…}, its errors, and the handles of joint(id).
#include <gtest/gtest.h>

#include "tests/unit/smartsurf/script/ScriptFixture.h"

namespace smartsurf::script {
namespace {

class JointBindingsTest : public ScriptTest {
 protected:
  // A ball, a fixed post and a block, with ids 0 to 2; `text` starts in line 2.
  static std::string with_objects(const std::string& text) {
    return "surface{} sphere{radius = 1, position = {0, 0, 5}} box{size = {1, 1, 1}, position = {3, 0, 5}, "
           "fixed = true} "
           "box{size = {1, 1, 1}, position = {6, 0, 5}}\n" +
           text;
  }
  std::string joint_error(const std::string& fields) {
    return error_of(with_objects("joint{" + fields + "}"));
  }
};

TEST_F(JointBindingsTest, Declares) {
  const Experiment e =
      load(with_objects("a = joint{kind = 'hinge', a = 0, b = 2, anchor = {1, 2, 3}, axis = {0, 1, 0}, "
                        "limits = {-1, 2}, friction = 3, "
                        "spring = {stiffness = 4, damping = 5, rest = 6}, motor = {speed = 7, max_torque = "
                        "8}, collide = true}\n"
                        "b = joint{kind = 'slider', a = 0, anchor = {1, 2, 3}, axis = {1, 0, 0}, motor = "
                        "{speed = 7, max_force = 8}}\n"
                        "assert(a == 0 and b == 1)"));
  const auto& joints = e.scene().joints;
  ASSERT_EQ(joints.size(), 2U);
  EXPECT_EQ(joints[0].kind, scene::JointKind::kHinge);
  EXPECT_EQ(joints[0].a, 0U);
  EXPECT_EQ(joints[0].b, 2U);
  EXPECT_EQ(joints[0].anchor, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(joints[0].axis, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(joints[0].limits->lower, -1.0);
  EXPECT_EQ(joints[0].limits->upper, 2.0);
  EXPECT_EQ(joints[0].friction, 3.0);
  EXPECT_EQ(joints[0].spring->stiffness, 4.0);
  EXPECT_EQ(joints[0].spring->damping, 5.0);
  EXPECT_EQ(joints[0].spring->rest, 6.0);
  EXPECT_EQ(joints[0].motor->speed, 7.0);
  EXPECT_EQ(joints[0].motor->max_effort, 8.0);
  EXPECT_TRUE(joints[0].collide);
  EXPECT_FALSE(joints[1].b);
  EXPECT_FALSE(joints[1].limits || joints[1].spring || joints[1].collide);
  EXPECT_EQ(joints[1].motor->max_effort, 8.0);
}

TEST_F(JointBindingsTest, RefusesWhatCannotBe) {
  EXPECT_EQ(joint_error("kind = 'hing', a = 0, anchor = {0, 0, 0}"),
            "t.lua:2: joint.kind = 'hing': must be 'hinge', 'slider', 'ball' or 'fixed'");
  EXPECT_EQ(joint_error("kind = 'hinge', a = 0, anchor = {0, 0, 0}"),
            "t.lua:2: joint: the field 'axis' is missing");
  EXPECT_EQ(joint_error("kind = 'ball', a = 7, anchor = {0, 0, 0}"),
            "t.lua:2: joint.a = 7: there is no such object; create it before the joint");
  EXPECT_EQ(joint_error("kind = 'ball', a = 1, anchor = {0, 0, 0}"),
            "t.lua:2: joint.a = 1: is fixed, and so is the table: one of them must be able to move");
  EXPECT_EQ(joint_error("kind = 'ball', a = 2, b = 2, anchor = {0, 0, 0}"),
            "t.lua:2: joint.b = 2: must be another object than a");
  EXPECT_EQ(joint_error("kind = 'ball', a = 0, anchor = {0, 0, 0}, limits = {0, 1}"),
            "t.lua:2: joint.limits: a ball joint has none; only hinge and slider do");
  for (const std::string kind : {"ball", "fixed"})
    EXPECT_EQ(joint_error("kind = '" + kind + "', a = 0, anchor = {0, 0, 0}, axis = {0, 0, 1}"),
              "t.lua:2: joint.axis: a " + kind + " joint has none; only hinge and slider do");
  EXPECT_EQ(joint_error("kind = 'hinge', a = 0, anchor = {0, 0, 0}, axis = {0, 0, 0}"),
            "t.lua:2: joint.axis: must not be zero");
  EXPECT_EQ(joint_error("kind = 'hinge', a = 0, anchor = {0, 0, 0}, axis = {0, 0, 1}, limits = {2, 1}"),
            "t.lua:2: joint.limits[2] = 1: must be not below limits[1] = 2");
  EXPECT_EQ(
      joint_error("kind = 'slider', a = 0, anchor = {0, 0, 0}, axis = {0, 0, 1}, spring = {stiffness = -1}"),
      "t.lua:2: joint.spring.stiffness = -1: must be in [0, 1e+12]");
  EXPECT_EQ(
      joint_error(
          "kind = 'hinge', a = 0, anchor = {0, 0, 0}, axis = {0, 0, 1}, motor = {speed = 1, max_force = 2}"),
      "t.lua:2: joint.motor: unknown field 'max_force' (did you mean 'max_torque'?)");
}

TEST_F(JointBindingsTest, HandlesReadAndDrive) {
  Experiment e = load(with_objects(
      "local j = joint{kind = 'slider', a = 0, anchor = {0, 0, 5}, axis = {1, 0, 0}}\n"
      "at(0, function()\n"
      "  print(joint(j):coordinate(), joint(j):speed(), joint(j):effort(), joint(j):id(), joint(j):force())\n"
      "  joint(j):motor{speed = 2, max_force = 3} joint(j):spring{stiffness = 4}\n"
      "  joint{kind = 'ball', a = object(0), b = 2, anchor = {0, 0, 5}}\n"
      "  print(joint(j) == joint(j), joint(j) == joint(1), joint(1))\n"
      "  joint(1):remove()\n"
      "end)"));
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  e.tick(0.0, 0);
  EXPECT_EQ(printed, "1.5\t2.5\t3.5\t0\t4.0\t5.0\t6.0\ntrue\tfalse\tjoint 1\n");
  const std::vector<std::string> expected{"motor 0 2 3", "spring 0 4 0 0", "joint 0 2", "remove joint 1"};
  EXPECT_EQ(simulation.log, expected);
}

TEST_F(JointBindingsTest, HandlesNeedAJointWithWhatTheyAskFor) {
  EXPECT_EQ(
      run_error_of("joint(3):force()"),
      "t.lua:2: joint:force: there is no joint 3 (removed, by itself or with an object, or never created)");
  EXPECT_EQ(
      run_error_of("joint{kind = 'ball', a = sphere{radius = 1, position = {0, 0, 5}}, anchor = {0, 0, 6}} "
                   "joint(0):coordinate()"),
      "t.lua:2: joint:coordinate: joint 0 is a ball joint; only hinge and slider have a coordinate");
  EXPECT_EQ(error_of("surface{} joint(0)").substr(0, 58),
            "t.lua:1: joint(id): there is no simulation while the scrip");
}

}  // namespace
}  // namespace smartsurf::script
