#include "smartsurf/view/interaction/Tools.h"

#include <gtest/gtest.h>

#include "smartsurf/view/interaction/Controls.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

Ray downward_ray(double x, double y) { return {{x, y, 100.0}, {0.0, 0.0, -1.0}}; }

struct ToolsTest : testing::Test {
  ToolsTest() : scene(16, 16), tools(scene.spec.surface) { scene.add_sphere(7.0, 5.0, 6.0, 2.0, {}); }
  FrameInput input() const { return {scene.snapshot, scene.spec.objects}; }
  TestScene scene;
  Tools tools;
};

TEST_F(ToolsTest, PullTargetFollowsPointer) {
  ASSERT_TRUE(tools.press(downward_ray(8.0, 5.0), input(), true));
  ASSERT_TRUE(tools.pull());
  EXPECT_EQ(tools.pull()->object, 0u);
  EXPECT_NEAR(tools.pull()->local_anchor.x(), 1.0, 1e-6);
  EXPECT_NEAR(tools.pull()->local_anchor.norm(), 2.0, 1e-6) << "the anchor is not on the surface";
  tools.move(downward_ray(11.0, 9.0), input());
  EXPECT_NEAR(tools.pull()->target.x(), 11.0, 1e-6);
  EXPECT_NEAR(tools.pull()->target.y(), 9.0, 1e-6);
  EXPECT_NEAR(tools.pull()->target.z(), 6.0 + std::sqrt(3.0), 1e-6) << "the target left its plane";
  ASSERT_TRUE(tools.selected());
  tools.release();
  EXPECT_FALSE(tools.pull());
}

TEST_F(ToolsTest, CellsAndFixedObjectsCannotBePulled) {
  EXPECT_FALSE(tools.press(downward_ray(1.0, 1.0), input(), true));
  scene.spec.objects[0].fixed = true;
  EXPECT_FALSE(tools.press(downward_ray(7.0, 5.0), input(), true));
}

TEST_F(ToolsTest, PokeFollowsPointerUntilRelease) {
  tools.active_tool = Tool::kPoke;
  tools.poke_height = 5.5;
  ASSERT_TRUE(tools.press(downward_ray(2.0, 3.0), input(), false));
  EXPECT_EQ(tools.poke()->row, 12);
  EXPECT_EQ(tools.poke()->column, 2);
  EXPECT_EQ(tools.poke()->height, 5.5);
  tools.move(downward_ray(3.0, 3.0), input());
  EXPECT_EQ(tools.poke()->column, 3);
  tools.release();
  EXPECT_FALSE(tools.poke());
}

TEST_F(ToolsTest, DropsObjectAboveClickedPoint) {
  tools.active_tool = Tool::kDrop;
  tools.drop_spec = {scene::ShapeKind::kBox, 0.5, 3.0, {1.0f, 0.0f, 0.0f}};
  ASSERT_TRUE(tools.press(downward_ray(2.0, 3.0), input(), false));
  const auto object = tools.take_drop();
  ASSERT_TRUE(object);
  EXPECT_EQ(object->shape, scene::ShapeKind::kBox);
  EXPECT_TRUE(object->position.isApprox(Eigen::Vector3d(2.0, 3.0, 4.0 + 3.0 + 0.5), 1e-6));
  EXPECT_EQ(scene::validate(*object), "");
  EXPECT_FALSE(tools.take_drop()) << "dropped twice";
}

TEST_F(ToolsTest, FaultIsReturnedOnce) {
  tools.active_tool = Tool::kBreak;
  tools.fault_kind = FaultKind::kDead;
  ASSERT_TRUE(tools.press(downward_ray(2.0, 3.0), input(), false));
  const auto fault = tools.take_fault();
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->row, 12);
  EXPECT_EQ(fault->kind, FaultKind::kDead);
  EXPECT_FALSE(tools.take_fault());
}

TEST_F(ToolsTest, CancelResetsToolThenSelection) {
  tools.select(downward_ray(7.0, 5.0), input());
  tools.active_tool = Tool::kDrop;
  tools.cancel();
  EXPECT_EQ(tools.active_tool, Tool::kPick);
  EXPECT_TRUE(tools.selected());
  tools.cancel();
  EXPECT_FALSE(tools.selected());
}

// Pointer events on an 800 × 600 image, as the window sends them.
struct PointerTest : testing::Test {
  PointerTest() : scene(16, 16), controls(scene.spec.surface) {
    scene.add_sphere(7.5, 7.5, 6.0, 3.0, {});
    controls.resize(800.0 / 600.0);
    status.accepts_interaction = true;
    target = controls.camera().project({7.5, 7.5, 6.0}, 800, 600);
  }
  void send_pointer(PointerEvent::Kind kind, double dx, double dy, bool control = false) {
    controls.handle_pointer(
        {kind, PointerEvent::Button::kLeft, target.x() + dx, target.y() + dy, control, false},
        {scene.snapshot, scene.spec.objects}, status, 800, 600);
  }
  TestScene scene;
  Controls controls;
  Status status;
  Eigen::Vector3d target;
};

TEST_F(PointerTest, ClickSelectsWithoutMovingCamera) {
  const double azimuth = controls.camera().azimuth();
  send_pointer(PointerEvent::Kind::kPress, 0, 0);
  send_pointer(PointerEvent::Kind::kMove, 1, 1);
  send_pointer(PointerEvent::Kind::kRelease, 1, 1);
  ASSERT_TRUE(controls.tools().selected());
  EXPECT_EQ(controls.tools().selected()->object, 0u);
  EXPECT_EQ(controls.camera().azimuth(), azimuth);
}

TEST_F(PointerTest, DragOrbitsWithoutSelecting) {
  const double azimuth = controls.camera().azimuth();
  send_pointer(PointerEvent::Kind::kPress, 0, 0);
  send_pointer(PointerEvent::Kind::kMove, 50, 0);
  send_pointer(PointerEvent::Kind::kRelease, 50, 0);
  EXPECT_FALSE(controls.tools().selected());
  EXPECT_NE(controls.camera().azimuth(), azimuth);
}

TEST_F(PointerTest, ControlDragPullsUntilRelease) {
  const double azimuth = controls.camera().azimuth();
  send_pointer(PointerEvent::Kind::kPress, 0, 0, true);
  send_pointer(PointerEvent::Kind::kMove, 60, 0, true);
  const Commands commands = controls.take_commands();
  ASSERT_TRUE(commands.pull);
  EXPECT_GT(commands.pull->target.x(), 8.0) << "the target did not move right";
  EXPECT_EQ(controls.camera().azimuth(), azimuth);
  EXPECT_TRUE(controls.take_commands().pull) << "the pull ended while the button was down";
  send_pointer(PointerEvent::Kind::kRelease, 60, 0, true);
  EXPECT_FALSE(controls.take_commands().pull);
}

TEST_F(PointerTest, CannotPullInRecording) {
  status.accepts_interaction = false;
  send_pointer(PointerEvent::Kind::kPress, 0, 0, true);
  send_pointer(PointerEvent::Kind::kMove, 60, 0, true);
  EXPECT_FALSE(controls.take_commands().pull);
}

TEST_F(PointerTest, CameraFollowsObjectUntilRemoved) {
  controls.tools().select(SceneItem{SceneItem::Kind::kObject, 0, 0, 0});
  controls.perform(UiAction::kFollow, status);
  scene.snapshot.position[0] = {2.0f, 3.0f, 5.0f};
  controls.update_camera(scene.snapshot, scene.spec.objects);
  EXPECT_TRUE(controls.camera().target().isApprox(Eigen::Vector3d(2.0, 3.0, 5.0)));
  scene.snapshot.id.clear();
  controls.update_camera(scene.snapshot, scene.spec.objects);
  EXPECT_FALSE(controls.followed());
}

TEST_F(PointerTest, NextChannelCycles) {
  const Channel channels[] = {{"height", "u", {}, 0, 6}, {"proximity", "u", {}, 0, 8}};
  controls.set_channels(channels);
  for (const char* expected : {"height", "proximity", "", "height"}) {
    controls.perform(UiAction::kNextChannel, status);
    EXPECT_EQ(controls.overlay().channel, expected);
  }
}

TEST_F(PointerTest, ResetRequiresCanReset) {
  controls.perform(UiAction::kReset, status);
  EXPECT_FALSE(controls.take_commands().reset);
  status.can_reset = true;
  controls.perform(UiAction::kReset, status);
  EXPECT_TRUE(controls.take_commands().reset);
}

}  // namespace
}  // namespace smartsurf::view
