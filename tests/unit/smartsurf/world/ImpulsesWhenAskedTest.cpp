// Impulses that are written when they are asked for are those that every step writes.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/world/NativeEngine.h"

namespace smartsurf::world {
namespace {

// Boxes that slide, or lie still until they sleep, some of them on others.
scene::SceneSpec boxes() {
  scene::SceneSpec s;
  s.world.dt_s = 1.0 / 120;
  s.surface.rows = s.surface.columns = 24;
  for (int i = 0; i < 30; ++i) {
    scene::ObjectSpec o;
    o.shape = scene::ShapeKind::kBox;
    o.size = {2.0, 1.5, 1.0};
    o.position = {2.0 + 4.0 * (i % 6), 2.0 + 5.0 * (i / 6 % 4), 0.51 + 1.01 * (i / 24)};
    if (i % 3 == 0) o.velocity = {0.5 + 0.1 * i, 0.2, 0.0};
    s.objects.push_back(o);
  }
  return s;
}

struct World {
  scene::SceneSpec scene = boxes();
  surface::ActuatorArray cells{scene.surface};
  NativeEngine engine{scene, cells.field()};

  void step() {
    cells.plan(scene.world.dt_s);
    engine.step();
    cells.commit(scene.world.dt_s);
  }
};

void expect_equal(const std::vector<ContactPoint>& a, const std::vector<ContactPoint>& b, int step) {
  ASSERT_EQ(a.size(), b.size()) << step;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].impulse, b[i].impulse) << step;
    ASSERT_EQ(a[i].point, b[i].point) << step;
  }
}

TEST(ImpulsesWhenAsked, AreThoseOfEveryStep) {
  World each_step, when_asked;
  when_asked.engine.write_impulses_when_asked();
  bool have_differed = false;
  int most_asleep = 0, loaded = 0;
  for (int step = 0; step < 300; ++step) {
    each_step.step(), when_asked.step();
    most_asleep = std::max(most_asleep, each_step.engine.sleeping_count());
    const std::vector<float>&wanted = each_step.cells.field().impulse,
          &written = when_asked.cells.field().impulse;
    have_differed |= written != wanted;
    // Changes between steps wake sleepers, also those that fell asleep in the last step.
    for (World* w : {&each_step, &when_asked}) {
      if (step % 40 == 20) w->engine.remove(static_cast<scene::ObjectId>(step / 40));
      if (step % 9 == 4) {
        scene::ObjectStateUpdate update;
        update.velocity = Eigen::Vector3d(1.0, 0.0, 0.0);
        w->engine.set_state(static_cast<scene::ObjectId>(12 + step % 7), update);
      }
    }
    if (step % 3 == 0) expect_equal(each_step.engine.contacts(), when_asked.engine.contacts(), step);
    if (step % 5 == 0) {
      when_asked.engine.write_impulses();
      ASSERT_EQ(written, wanted) << step;
      for (const float impulse : wanted) loaded += impulse > 0.0F ? 1 : 0;
    }
    if (HasFatalFailure()) return;
  }
  EXPECT_TRUE(have_differed);
  EXPECT_GT(most_asleep, 10);
  EXPECT_GT(loaded, 1000);
}

TEST(ImpulsesWhenAsked, AreSaved) {
  World each_step, when_asked, restored;
  when_asked.engine.write_impulses_when_asked();
  for (int step = 0; step < 120; ++step) {
    each_step.step(), when_asked.step();
    if (step % 20 != 0) continue;
    std::string bytes;
    common::StateArchive out(bytes);
    when_asked.engine.archive(out, when_asked.scene.objects, when_asked.scene.objects.size());
    common::StateArchive in{std::string_view(bytes)};
    restored.engine.archive(in, restored.scene.objects, restored.scene.objects.size());
    ASSERT_EQ(when_asked.cells.field().impulse, each_step.cells.field().impulse) << step;
    expect_equal(each_step.engine.contacts(), restored.engine.contacts(), step);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace smartsurf::world
