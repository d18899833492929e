#include "smartsurf/view/interaction/Controls.h"

#include <gtest/gtest.h>

#include "smartsurf/view/model/TableBounds.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

TEST(Controls, TakeCommandsClearsCommands) {
  Controls controls{scene::SurfaceSpec{}};
  const Status status;
  controls.perform(UiAction::kPause, status);
  controls.perform(UiAction::kStep, status);
  controls.perform(UiAction::kStep, status);
  controls.perform(UiAction::kQuit, status);
  const Commands commands = controls.take_commands();
  EXPECT_TRUE(commands.toggle_pause);
  EXPECT_EQ(commands.steps, 2);
  EXPECT_TRUE(commands.quit);
  EXPECT_FALSE(commands.pace.has_value());
  const Commands again = controls.take_commands();
  EXPECT_FALSE(again.toggle_pause);
  EXPECT_EQ(again.steps, 0);
  EXPECT_FALSE(again.quit);
}

TEST(Controls, EndedRunIsOnlyLookedBackAtOrRestarted) {
  Controls controls{scene::SurfaceSpec{}};
  Status status;
  status.run_ended = status.can_reset = true;
  for (const UiAction action : {UiAction::kPause, UiAction::kStepBack, UiAction::kReset})
    controls.perform(action, status);
  const Commands commands = controls.take_commands();
  EXPECT_FALSE(commands.toggle_pause);
  EXPECT_EQ(commands.steps, -1);
  EXPECT_TRUE(commands.reset);
}

TEST(Controls, TwoPausesInOneFrameCancelOut) {
  Controls controls{scene::SurfaceSpec{}};
  controls.perform(UiAction::kPause, {});
  controls.perform(UiAction::kPause, {});
  EXPECT_FALSE(controls.take_commands().toggle_pause);
}

TEST(Controls, PaceStepsThroughPowersOfTwoUpToMax) {
  EXPECT_DOUBLE_EQ(Controls::faster_pace(1.0), 2.0);
  EXPECT_DOUBLE_EQ(Controls::slower_pace(1.0), 0.5);
  EXPECT_DOUBLE_EQ(Controls::faster_pace(0.3), 0.5);
  EXPECT_DOUBLE_EQ(Controls::slower_pace(0.3), 0.25);
  EXPECT_DOUBLE_EQ(Controls::faster_pace(32.0), 0.0);
  EXPECT_DOUBLE_EQ(Controls::slower_pace(0.0), 32.0);
  EXPECT_DOUBLE_EQ(Controls::faster_pace(0.0), 0.0);
  EXPECT_DOUBLE_EQ(Controls::slower_pace(1.0 / 16.0), 1.0 / 16.0);
  EXPECT_DOUBLE_EQ(Controls::faster_pace(1e-5), 1.0 / 16.0);
}

TEST(Controls, PaceChangesOfOneFrameAccumulate) {
  Controls controls{scene::SurfaceSpec{}};
  Status status;
  status.requested_pace = 1.0;
  controls.perform(UiAction::kFaster, status);
  controls.perform(UiAction::kFaster, status);
  EXPECT_DOUBLE_EQ(controls.take_commands().pace.value(), 4.0);
  controls.perform(UiAction::kMaxPace, status);
  EXPECT_DOUBLE_EQ(controls.take_commands().pace.value(), 0.0);
  status.requested_pace = 0.0;
  controls.perform(UiAction::kMaxPace, status);
  EXPECT_DOUBLE_EQ(controls.take_commands().pace.value(), 1.0);
}

TEST(Controls, ResizeRefitsUnmodifiedPreset) {
  const scene::SurfaceSpec surface;
  Controls controls{surface};
  controls.resize(0.5);
  EXPECT_DOUBLE_EQ(controls.camera().distance(),
                   Camera::fit_to_surface(surface, CameraPreset::kIso, 0.5).distance());
  controls.perform(UiAction::kTop, {});
  controls.orbit_or_pan(PointerDrag::kOrbit, 10.0, 0.0, 700.0);
  const double distance = controls.camera().distance();
  controls.resize(3.0);
  EXPECT_DOUBLE_EQ(controls.camera().distance(), distance) << "the user's view was discarded";
}

// Presets are fitted to the objects of the next frame, and not to where these move later.
TEST(Controls, PresetsShowTheObjectsOverTheTable) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 16.0, 2.0, {});
  const auto corners = corners_of_objects_over(scene.spec.surface, scene.snapshot, scene.spec.objects);
  Controls controls{scene.spec.surface};
  controls.resize(1.5);
  const auto update = [&] { controls.update_camera(scene.snapshot, scene.spec.objects); };
  const auto fitted = [&](CameraPreset preset, double aspect) {
    return Camera::fit_to_surface(scene.spec.surface, preset, aspect, corners).eye();
  };
  update();
  EXPECT_EQ(controls.camera().eye(), fitted(CameraPreset::kIso, 1.5));
  scene.snapshot.position[0][2] = 5.0F;
  update();
  controls.resize(2.0);
  update();
  EXPECT_EQ(controls.camera().eye(), fitted(CameraPreset::kIso, 2.0));
  scene.snapshot.position[0][2] = 16.0F;
  controls.perform(UiAction::kSide, {});
  update();
  EXPECT_EQ(controls.camera().eye(), fitted(CameraPreset::kSide, 2.0));
  controls.perform(UiAction::kIso, {});
  controls.handle_scroll(1.0);
  const Eigen::Vector3d eye = controls.camera().eye();
  update();
  EXPECT_EQ(controls.camera().eye(), eye) << "the user's view was discarded";
}

TEST(Controls, OrbitPanAndScrollMoveCamera) {
  Controls controls{scene::SurfaceSpec{}};
  const Camera start = controls.camera();
  controls.orbit_or_pan(PointerDrag::kOrbit, 100.0, 0.0, 700.0);
  EXPECT_NE(controls.camera().azimuth(), start.azimuth());
  EXPECT_TRUE(controls.camera().target().isApprox(start.target()));
  controls.orbit_or_pan(PointerDrag::kPan, 100.0, 0.0, 700.0);
  EXPECT_FALSE(controls.camera().target().isApprox(start.target()));
  controls.handle_scroll(2.0);
  EXPECT_LT(controls.camera().distance(), start.distance());
}

TEST(ControlsSettings, SwitchesReportTheirState) {
  Controls controls(scene::SurfaceSpec{});
  for (const UiAction action :
       {UiAction::kWireframe, UiAction::kGrid, UiAction::kLabels, UiAction::kTrails, UiAction::kContactForces,
        UiAction::kSensorRays, UiAction::kEntities, UiAction::kPlots, UiAction::kPanels, UiAction::kHelp}) {
    const bool before = controls.is_on(action);
    controls.perform(action, {});
    EXPECT_NE(controls.is_on(action), before) << static_cast<int>(action);
  }
  EXPECT_FALSE(controls.is_on(UiAction::kQuit));
}

TEST(ControlsSettings, ApplyAndPastePlaceTheCamera) {
  Controls controls(scene::SurfaceSpec{});
  ViewSettings settings;
  settings.camera.pose = CameraPose{{10.0, -20.0, 30.0}, {1.0, 2.0, 3.0}};
  settings.overlay.trails = true;
  settings.plots = {*parse_signal("speed:0")};
  controls.apply(settings);
  EXPECT_LT((controls.camera().eye() - settings.camera.pose->position).norm(), 1e-9);
  EXPECT_TRUE(controls.is_on(UiAction::kTrails));
  EXPECT_TRUE(controls.plots_shown());
  controls.resize(0.7);  // another window size does not move a given camera
  EXPECT_LT((controls.camera().target() - settings.camera.pose->target).norm(), 1e-9);
  EXPECT_FALSE(controls.paste_camera("somewhere"));
  EXPECT_TRUE(controls.paste_camera("5,5,40:5,5,0"));
  EXPECT_LT((controls.camera().target() - Eigen::Vector3d(5.0, 5.0, 0.0)).norm(), 1e-9);
}

}  // namespace
}  // namespace smartsurf::view
