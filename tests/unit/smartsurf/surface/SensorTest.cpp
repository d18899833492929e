#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/ColourSensor.h"
#include "smartsurf/surface/sensors/Sensor.h"
#include "smartsurf/surface/sensors/SensorRegistry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "tests/unit/smartsurf/surface/SensorFixture.h"

using namespace smartsurf;
using surface::SensorArray;
using surface::SensorFixture;

namespace {

const scene::Colour kRed{0.9F, 0.1F, 0.2F};

}  // namespace

TEST(Proximity, ReadsDistanceToBallAndRangeElsewhere) {
  SensorFixture t;
  t.add_ball(5, 7, 6, 2);
  t.height(5, 7) = 1.5F;
  t.add_sensor("proximity");
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FLOAT_EQ(s.readings(0)[t.cell(5, 7)], 2.5F);  // 6 − 2 − 1.5
  EXPECT_EQ(s.readings(1)[t.cell(5, 7)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(0, 0)], 8.0F);
  EXPECT_EQ(s.readings(1)[t.cell(0, 0)], 0.0F);
  EXPECT_EQ(std::ranges::count(s.readings(1), 1.0F), 13);  // cells with dx² + dy² ≤ 4
}

TEST(Proximity, RayStartingInsideReadsZero) {
  SensorFixture t;
  t.add_ball(5, 7, 1, 2);
  t.add_sensor("proximity");
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(5, 7)], 0.0F);
  EXPECT_EQ(s.readings(1)[t.cell(5, 7)], 1.0F);
}

// A surface this small counts as dense, so the cast culls bodies whose height no ray reaches.
TEST(Proximity, HitsBallWithOnlyLowestPartInRange) {
  SensorFixture t(3, 3);
  t.add_ball(1, 1, 5.5, 2);
  t.add_sensor("proximity", {{"range", {3.6}}}).name = "reaches";
  t.add_sensor("proximity", {{"range", {3.4}}}).name = "too short";
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FLOAT_EQ(s.readings(0)[t.cell(1, 1)], 3.5F);  // 5.5 − 2
  EXPECT_EQ(s.readings(1)[t.cell(1, 1)], 1.0F);
  EXPECT_EQ(s.readings(3)[t.cell(1, 1)], 0.0F);
}

TEST(Proximity, SupportsAnyDirectionAndOrigin) {
  SensorFixture t;
  t.add_ball(9, 7, 0.5, 1);
  t.add_sensor("proximity", {{"direction", {3, 0, 0}}, {"origin", {0, 0, 0.5}}}).name = "east";
  t.add_sensor("proximity", {{"direction", {0, 0, -1}}, {"origin", {0, 0, 5}}}).name = "down";
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FLOAT_EQ(s.readings(0)[t.cell(4, 7)], 4.0F);
  EXPECT_EQ(s.readings(1)[t.cell(11, 7)], 0.0F);              // the ball is behind the ray
  EXPECT_EQ(s.readings(0)[t.cell(9, 7)], 0.0F);               // the ray starts inside the ball
  EXPECT_FLOAT_EQ(s.readings(2)[t.cell(9, 7)], 5.0F - 1.5F);  // the ball's top
  EXPECT_FLOAT_EQ(s.readings(2)[t.cell(1, 1)], 5.0F);         // top of its own pin
}

TEST(Proximity, HigherPinsOccludeUnlessExcluded) {
  SensorFixture t;
  t.add_ball(9, 7, 0.5, 1);
  t.height(7, 7) = 2;
  t.add_sensor("proximity", {{"direction", {1, 0, 0}}, {"origin", {0, 0, 0.5}}}).name = "sees";
  t.add_sensor("proximity", {{"direction", {1, 0, 0}}, {"origin", {0, 0, 0.5}}, {"pins", {0}}}).name =
      "ignores";
  t.add_sensor("object_type", {{"direction", {1, 0, 0}}, {"origin", {0, 0, 0.5}}}).name = "type";
  t.add_sensor("colour", {{"direction", {1, 0, 0}}, {"origin", {0, 0, 0.5}}}).name = "colour";
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FLOAT_EQ(s.readings(0)[t.cell(4, 7)], 2.6F);  // side of the pin at x = 7
  EXPECT_FLOAT_EQ(s.readings(2)[t.cell(4, 7)], 4.0F);
  EXPECT_EQ(s.readings(4)[t.cell(4, 7)], 0.0F);  // pins have no object type
  EXPECT_EQ(s.readings(4)[t.cell(7, 7)], 0.0F);  // the ray from the raised top passes over the ball
  EXPECT_EQ(s.readings(5)[t.cell(4, 7)], surface::kPinColour.r);
}

TEST(Proximity, LevelPinsDoNotOcclude) {
  SensorFixture t;
  t.add_sensor("proximity", {{"direction", {1, 0.5, 0}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(std::ranges::count(s.readings(1), 0.0F), t.spec.cell_count());
}

TEST(ObjectType, NumbersLabelsInOrderOfAppearance) {
  SensorFixture t;
  t.add_ball(2, 2, 3, 1, "b");
  t.add_ball(6, 2, 3, 1, "a");
  t.add_ball(10, 2, 3, 1);
  t.add_ball(14, 2, 3, 1, "b");
  t.add_sensor("object_type");
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(2, 2)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(6, 2)], 2.0F);
  EXPECT_EQ(s.readings(0)[t.cell(10, 2)], 3.0F);
  EXPECT_EQ(s.readings(0)[t.cell(14, 2)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(4, 8)], 0.0F);
  EXPECT_EQ(s.channels()[0].type, scene::SensorChannel::Type::kUint32);
  // Classes stay the same when labels are added and objects removed.
  t.add_ball(2, 9, 3, 1, "c");
  t.snapshot.id.erase(t.snapshot.id.begin());
  t.snapshot.position.erase(t.snapshot.position.begin());
  t.snapshot.orientation.erase(t.snapshot.orientation.begin());
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(2, 2)], 0.0F);
  EXPECT_EQ(s.readings(0)[t.cell(6, 2)], 2.0F);
  EXPECT_EQ(s.readings(0)[t.cell(2, 9)], 4.0F);
}

TEST(Colour, ReadsNearestObjectInThreePlanes) {
  SensorFixture t;
  t.add_ball(5, 5, 6, 1, "", {0.0F, 1.0F, 0.0F});
  t.add_ball(5, 5, 3, 1, "", kRed);
  t.add_sensor("colour");
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  const auto cells = static_cast<std::size_t>(t.spec.cell_count());
  ASSERT_EQ(s.readings(0).size(), 3 * cells);
  EXPECT_EQ(s.readings(0)[t.cell(5, 5)], kRed.r);
  EXPECT_EQ(s.readings(0)[cells + t.cell(5, 5)], kRed.g);
  EXPECT_EQ(s.readings(0)[2 * cells + t.cell(5, 5)], kRed.b);
  EXPECT_EQ(s.readings(0)[cells + t.cell(9, 9)], 0.0F);
  t.snapshot.position[1][0] = 12;  // remove the closer ball
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(5, 5)], 0.0F);
  EXPECT_EQ(s.readings(0)[cells + t.cell(5, 5)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(12, 5)], kRed.r);
}

TEST(Light, ShadowedByBallsAndPins) {
  SensorFixture t;
  t.add_ball(8, 8, 10, 1);
  t.height(3, 3) = 4;
  t.add_sensor("light", {{"direction", {1, 0, 1}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  // The ball's shadow lies 10 u west of it at x = −2, off the surface; the pin's extends 4 u to the west.
  EXPECT_EQ(s.readings(0)[t.cell(2, 3)], 0.0F);
  EXPECT_EQ(s.readings(0)[t.cell(0, 3)], 0.0F);
  EXPECT_EQ(s.readings(0)[t.cell(3, 3)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(4, 3)], 1.0F);
  t.snapshot.position[0] = {14, 8, 10};
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(4, 8)], 0.0F);
  EXPECT_EQ(s.readings(0)[t.cell(8, 8)], 1.0F);
}

TEST(Light, AreaLightCastsPenumbra) {
  SensorFixture t;
  scene::ObjectSpec screen;  // covers x ≥ 10
  screen.shape = scene::ShapeKind::kBox;
  screen.size = {20, 40, 0.1};
  screen.position = {20, 8, 10};
  t.add(screen);
  t.add_sensor("light", {{"size", {0.3}}, {"samples", {64}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(s.readings(0)[t.cell(2, 8)], 1.0F);
  EXPECT_EQ(s.readings(0)[t.cell(18, 8)], 0.0F);
  EXPECT_NEAR(s.readings(0)[t.cell(10, 8)], 0.5F, 0.05F);
  // The edge appears at (10 − x)/10 from the centre of a disc of radius tan 0.3: the area of a circular
  // segment.
  const double d = 0.2 / std::tan(0.3);
  EXPECT_NEAR(s.readings(0)[t.cell(8, 8)], 1 - (std::acos(d) - d * std::sqrt(1 - d * d)) / std::numbers::pi,
              0.05);
}

TEST(Pressure, ReadsImpulsePerTickClampedToRange) {
  SensorFixture t;
  t.add_sensor("pressure", {{"range", {50}}});
  SensorArray s = t.sensors();
  std::vector<float> impulse(static_cast<std::size_t>(t.spec.cell_count()), 0.0F);
  impulse[t.cell(3, 4)] = 0.1F;
  impulse[t.cell(4, 4)] = 1.0F;
  for (int step = 0; step < 4; ++step) s.accumulate_impulses(impulse);
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_FLOAT_EQ(s.readings(0)[t.cell(3, 4)], 24.0F);  // 4 · 0.1 in 1/60 s
  EXPECT_EQ(s.readings(0)[t.cell(4, 4)], 50.0F);
  EXPECT_EQ(s.readings(0)[t.cell(5, 4)], 0.0F);
  s.sense(t.snapshot, t.catalogue, t.pool);  // no impulses since the last tick
  EXPECT_EQ(s.readings(0)[t.cell(3, 4)], 0.0F);
}

TEST(Camera, ShowsTopmostSurfaceAtEveryPixel) {
  SensorFixture t;
  scene::ObjectSpec tile;
  tile.shape = scene::ShapeKind::kBox;
  tile.size = {0.9, 0.4, 0.2};
  tile.position = {5, 5.25, 3};
  tile.colour = kRed;
  t.add(tile);
  t.height(8, 8) = 1.5F;
  t.add_sensor("camera", {{"resolution", {2}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  const auto cells = static_cast<std::size_t>(t.spec.cell_count());
  ASSERT_EQ(s.readings(0).size(), 12 * cells);
  ASSERT_EQ(s.readings(1).size(), 4 * cells);
  // The tile covers the northern pixels, 0 and 1, of its cell.
  EXPECT_NEAR(s.readings(1)[0 * cells + t.cell(5, 5)], 3.1F, 1e-4F);
  EXPECT_NEAR(s.readings(1)[1 * cells + t.cell(5, 5)], 3.1F, 1e-4F);
  EXPECT_NEAR(s.readings(1)[2 * cells + t.cell(5, 5)], 0.0F, 1e-4F);
  EXPECT_EQ(s.readings(0)[0 * cells + t.cell(5, 5)], kRed.r);
  EXPECT_EQ(s.readings(0)[5 * cells + t.cell(5, 5)], kRed.b);
  EXPECT_EQ(s.readings(0)[6 * cells + t.cell(5, 5)], surface::kPinColour.r);  // pin colour
  EXPECT_NEAR(s.readings(1)[t.cell(8, 8)], 1.5F, 1e-4F);
}

TEST(Camera, SeesFloorThroughGaps) {
  SensorFixture t;
  t.field.half_top_x = t.field.half_top_y = 0.1F;
  t.add_sensor("camera", {{"resolution", {2}}, {"floor", {-3}}});
  SensorArray s = t.sensors();
  s.sense(t.snapshot, t.catalogue, t.pool);
  EXPECT_EQ(std::ranges::count(s.readings(1), -3.0F), 4 * t.spec.cell_count());
  EXPECT_EQ(std::ranges::count(s.readings(0), 0.0F), 12 * t.spec.cell_count());
}

TEST(SensorArray, BitIdenticalForAnyThreadCount) {
  SensorFixture t(33, 37);
  for (int k = 0; k < 40; ++k) {
    scene::ObjectSpec o;
    o.shape = static_cast<scene::ShapeKind>(k % 5);
    o.position = {1.0 * ((k * 7) % 37), 1.0 * ((k * 11) % 33), 2.5};
    o.size = {3, 2, 1};
    o.height = 3;
    o.orientation = Eigen::AngleAxisd(k, Eigen::Vector3d(1, 2, 3).normalized());
    t.add(o);
  }
  t.add_sensor("proximity", {{"noise", {0.1}}, {"drift", {0.2}}, {"dropout", {0.1}}});
  t.add_sensor("colour", {{"direction", {1, 1, 1}}, {"noise", {0.1}}, {"latency", {2}}});
  t.add_sensor("light", {{"size", {0.1}}, {"direction", {0.2, 0, 1}}});
  t.add_sensor("camera", {{"resolution", {2}}});
  std::vector<std::vector<float>> first;
  for (const int threads : {1, 2, 5}) {
    common::ThreadPool pool(threads, 0.0);  // always runs in parallel
    SensorArray s = t.sensors();
    for (int tick = 0; tick < 4; ++tick) s.sense(t.snapshot, t.catalogue, pool);
    for (std::size_t k = 0; k < s.channels().size(); ++k) {
      const auto readings = s.readings(static_cast<int>(k));
      if (threads == 1) first.emplace_back(readings.begin(), readings.end());
      EXPECT_TRUE(std::ranges::equal(first[k], readings))
          << s.channels()[k].name << ", " << threads << " threads";
    }
  }
}

// After a restore the objects from some id on may be others.
TEST(SensorArray, RestoredObjectsReplaceThoseSensedBefore) {
  SensorFixture abandoned, saved;
  for (SensorFixture* t : {&abandoned, &saved}) {
    t->add_sensor("proximity");
    t->add_sensor("object_type");
    t->add_sensor("colour");
    t->add_ball(15, 12, 6, 1, "first");
  }
  abandoned.add_ball(5, 7, 6, 1, "second", {0.1F, 0.2F, 0.3F});
  saved.add_ball(5, 7, 6, 2, "third", kRed);
  scene::ObjectSpec box;
  box.size = {2, 2, 2};
  box.position = {10, 3, 6};
  abandoned.add(box);
  box.size = {4, 4, 4};
  box.label = "third";
  saved.add(box);

  std::string bytes;
  SensorArray original = saved.sensors(), restored = abandoned.sensors();
  original.sense(saved.snapshot, saved.catalogue, saved.pool);
  restored.sense(abandoned.snapshot, abandoned.catalogue, abandoned.pool);
  common::StateArchive out(bytes);
  original.archive(out, saved.snapshot, saved.catalogue, saved.pool);
  common::StateArchive in{std::string_view(bytes)};
  restored.archive(in, saved.snapshot, saved.catalogue, saved.pool);
  for (int channel = 0; channel < 4; ++channel)
    EXPECT_TRUE(std::ranges::equal(restored.readings(channel), original.readings(channel))) << channel;
  EXPECT_EQ(restored.readings(2)[saved.cell(5, 7)], 2.0F);  // "first", "third"
}

TEST(SensorArray, RejectsUnknownModel) {
  SensorFixture t;
  t.add_sensor("proximity");
  EXPECT_EQ(surface::error_message_of([&] {
              scene::SensorSpec spec = t.spec.sensors[0];
              spec.model = "smell";
              surface::make_sensor(t.field, spec);
            }),
            "no sensor is called 'smell'");
}
