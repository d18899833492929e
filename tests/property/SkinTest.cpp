// Skins over the actuators, and objects on them, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "smartsurf/scene/KindRegistry.h"
#include "tests/property/PhysicsFixture.h"
#include "tests/property/Swing.h"

using namespace physics_fixture;
using namespace smartsurf;

namespace {

// The height of each cell at the start, u.
using Relief = std::function<double(int row, int column)>;
double level(int /*row*/, int /*column*/) { return 0.0; }

struct SkinCase {
  int rows = 8, columns = 8;
  double top_x = 0.8, top_y = 0.8;  // u; 0: the cells hold the skin at points
  Relief relief = level;
  scene::SkinSpec skin = {};
  int nodes_per_pitch = 8;
  std::function<bool(int row, int column)> has_cell = [](int, int) { return true; };
};

// Pins one pitch apart under a skin, which ends at the outermost cells' centres plus the margin.
void set_skin(PhysicsFixture& fixture, SkinCase setup) {
  scene::SurfaceSpec& surface = fixture.scene.surface;
  surface.rows = setup.rows, surface.columns = setup.columns;
  scene::ActuatorSpec spec = scene::find_actuator_kind("pin")->default_spec();
  spec.values["range"] = {-10, 10};
  if (setup.top_x == 0.0) spec.values["tip.shape"] = {1.0};  // hemispheres
  spec.values["top"] = {setup.top_x == 0.0 ? 0.8 : setup.top_x, setup.top_y == 0.0 ? 0.8 : setup.top_y};
  surface.actuators = {spec};
  for (int r = 0; r < setup.rows; ++r)
    for (int c = 0; c < setup.columns; ++c)
      surface.base_heights.push_back(static_cast<float>(10.0 + setup.relief(r, c))),
          surface.actuator_of_cell.push_back(setup.has_cell(r, c) ? std::int8_t{0} : scene::kEmptyCell);
  derive_pin_spec(surface);
  const auto nodes = [&setup](int cells) {
    return static_cast<int>(std::lround(setup.nodes_per_pitch * (cells - 1 + 2.0 * setup.skin.margin))) + 1;
  };
  setup.skin.rows = nodes(setup.rows), setup.skin.columns = nodes(setup.columns);
  surface.skin = setup.skin;
  ASSERT_EQ(scene::validate(surface), "");
}

const surface::Skin& skin_of(PhysicsFixture& fixture) { return fixture.cells().field().skin; }

float height_at(PhysicsFixture& fixture, double x, double y) {
  const surface::Skin& skin = skin_of(fixture);
  return skin.locate(static_cast<float>(x), static_cast<float>(y)).interpolate(skin.height);
}

// Vertical force of the objects on the skin in the last step.
double load_on(PhysicsFixture& fixture) {
  const std::vector<float>& impulse = skin_of(fixture).impulse;
  return std::accumulate(impulse.begin(), impulse.end(), 0.0) / fixture.scene.world.dt_s;
}

class Skin : public testing::TestWithParam<double> {
 protected:
  Skin() { fixture.scene.world.dt_s = GetParam(); }
  PhysicsFixture fixture;
};
INSTANTIATE_TEST_SUITE_P(Steps, Skin, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

// Points hold the skin in a plane that rises to the east. Its free edges bend it, by e^(−2π) at one pitch
// from them.
SkinCase ramp(double angle) {
  return {5, 24, 0, 0, [=](int, int column) { return std::tan(angle) * column; }, {}};
}

}  // namespace

TEST(SkinShape, IsRampBetweenLinesOfSupports) {
  PhysicsFixture fixture;
  set_skin(fixture,
           {4, 8, 0.25, 1.0, [](int, int column) { return column == 3 ? 2.0 : 0.0; }, {.margin = 0.5}});
  for (const double y : {-0.25, 1.0, 3.375}) {
    EXPECT_NEAR(height_at(fixture, 3.0, y), 2.0, 1e-5);
    EXPECT_NEAR(height_at(fixture, 3.5, y), 1.0, 1e-5);
    EXPECT_NEAR(height_at(fixture, 3.125 + 0.25, y), 2.0 * 2 / 3, 1e-5);
    EXPECT_NEAR(height_at(fixture, 6.5, y), 0.0, 1e-5);
  }
}

TEST(SkinShape, HasMeanOfItsNeighboursBetweenSupports) {
  // Laplace's equation on a square grid; a function that fulfils it has its extremes on the supports.
  PhysicsFixture fixture;
  const Relief relief = [](int row, int column) { return 0.5 * ((3 * row + 5 * column) % 7); };
  set_skin(fixture, {6, 6, 0.5, 0.25, relief, {.margin = 0.5}});
  const surface::Skin& skin = skin_of(fixture);
  int checked = 0;
  for (int r = 1; r + 1 < skin.rows; ++r)
    for (int c = 1; c + 1 < skin.columns; ++c) {
      const auto from_centre = [](float u) { return std::abs(u - std::round(u)); };
      const Eigen::Vector3f at = skin.node(r, c);
      const int row = 5 - static_cast<int>(std::round(at.y())), column = static_cast<int>(std::round(at.x()));
      if (from_centre(at.x()) < 0.3F && from_centre(at.y()) < 0.15F) {
        EXPECT_NEAR(at.z(), relief(row, column), 1e-6);
        continue;
      }
      const float mean =
          0.25F * (skin.node(r - 1, c) + skin.node(r + 1, c) + skin.node(r, c - 1) + skin.node(r, c + 1)).z();
      EXPECT_NEAR(at.z(), mean, 1e-5);
      ++checked;
    }
  EXPECT_GT(checked, 1000);
  EXPECT_EQ(*std::ranges::max_element(skin.height), 3.0F);
}

TEST(SkinShape, ClampedEdgeKeepsItsHeight) {
  PhysicsFixture fixture;
  scene::SkinSpec skin{.margin = 1.0, .edge = scene::SkinSpec::Edge::kClamped, .edge_height = -0.5};
  set_skin(fixture, {4, 4, 0.25, 1.0, level, skin});
  EXPECT_NEAR(height_at(fixture, -1.0, 1.5), -0.5, 1e-6);
  EXPECT_NEAR(height_at(fixture, 0.0, 1.5), 0.0, 1e-6);
  EXPECT_NEAR(height_at(fixture, -0.5625, 1.5), -0.25, 1e-3);  // the other edges are far
}

TEST_P(Skin, FollowsActuators) {
  set_skin(fixture, {4, 8, 0.25, 1.0, level, {.margin = 0.5}});
  for (int row = 0; row < 4; ++row) fixture.cells().set_target(0, row, 3, -9.0F);  // from −10
  fixture.run(0.05);
  const float rising = fixture.cells().field().height[3];
  EXPECT_GT(rising, 0.01);
  EXPECT_LT(rising, 0.99);
  EXPECT_NEAR(height_at(fixture, 3.5, 1.0), 0.5 * rising, 1e-5);
  EXPECT_NEAR(skin_of(fixture).locate(3.5F, 1.0F).interpolate(skin_of(fixture).speed),
              0.5F * fixture.cells().field().speed[3], 1e-4);
  fixture.run(1.0);
  EXPECT_NEAR(height_at(fixture, 3.5, 1.0), 0.5, 1e-5);
  EXPECT_EQ(*std::ranges::max_element(skin_of(fixture).speed), 0.0F);
}

TEST_P(Skin, BearsSmallObjectsBetweenActuators) {
  set_skin(fixture, {8, 8, 0.25, 0.25, level, {.margin = 0.5}});
  const auto marble = fixture.add(sphere(0.1, {3.5, 3.5, 0.101}));
  const auto crumb = fixture.add(box({0.1, 0.1, 0.1}, {2.45, 3.5, 0.051}));
  fixture.run(1.0);
  EXPECT_NEAR(fixture.position(marble).z(), 0.1, 2e-3);
  EXPECT_NEAR(fixture.position(crumb).z(), 0.05, 2e-3);
}

TEST_P(Skin, BearsEveryShape) {
  set_skin(fixture, {16, 16, 0.8, 0.8, level, {.margin = 0.5}});
  auto on_side = cylinder(0.5, 1.5, {9, 2, 0.501}), tube = capsule(0.5, 2, {9, 5, 0.501});
  on_side.orientation = tube.orientation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX());
  struct Rest {
    scene::ObjectSpec object;
    double height;
  };
  const std::vector<Rest> rests{{sphere(1, {2, 2, 1.001}), 1},
                                {box({2, 2, 1}, {2, 5, 0.501}), 0.5},
                                {cylinder(1, 1, {2, 8, 0.501}), 0.5},
                                {on_side, 0.5},
                                {tube, 0.5},
                                {cone(1, 2, {9, 9, 0.501}), 0.5},
                                {cube({2, 12, 1.001}), 1.0}};
  double weight = 0.0;
  for (const Rest& rest : rests) {
    fixture.add(rest.object);
    weight += kGravity * rest.object.volume();
  }
  fixture.run(0.4);
  for (std::size_t i = 0; i < rests.size(); ++i) {
    const auto id = static_cast<scene::ObjectId>(i);
    EXPECT_NEAR(fixture.position(id).z(), rests[i].height, 4e-3) << i;
    EXPECT_LT(fixture.velocity(id).norm(), 0.02) << i;
  }
  EXPECT_NEAR(load_on(fixture), weight, 0.01 * weight);
}

TEST_P(Skin, BallRollsDownRampWithoutBumps) {
  const double angle = 0.15, radius = 0.3;
  set_skin(fixture, ramp(angle));
  const double x = 18.0, along = 5.0 / 7.0 * kGravity * std::sin(angle);
  const Eigen::Vector3d normal(-std::sin(angle), 0, std::cos(angle));
  const auto ball =
      fixture.add(sphere(radius, Eigen::Vector3d(x, 2.3, x * std::tan(angle)) + radius * normal));
  const Eigen::Vector3f from = fixture.position(ball);
  double farthest_from_plane = 0.0;
  std::uint32_t most_contacts = 0;  // two where it is over the edge of two triangles
  fixture.run(2.5, [&] {
    most_contacts = std::max(most_contacts, fixture.snapshot().contact_count);
    const Eigen::Vector3d moved = (fixture.position(ball) - from).cast<double>();
    farthest_from_plane = std::max(farthest_from_plane, std::abs(moved.dot(normal)));
  });
  EXPECT_NEAR((fixture.position(ball) - from).norm(), 0.5 * along * 2.5 * 2.5,
              0.01 * 0.5 * along * 2.5 * 2.5);
  EXPECT_NEAR(fixture.velocity(ball).norm(), along * 2.5, 0.01 * along * 2.5);
  EXPECT_LT(farthest_from_plane, 2e-3);
  EXPECT_LE(most_contacts, 2U);
  EXPECT_NEAR(fixture.position(ball).y(), 2.3, 1e-3);
}

TEST_P(Skin, BoxSlidesDownRampAgainstFriction) {
  for (const double angle : {0.4, 0.7}) {  // atan µ = 0.46
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    set_skin(bench, ramp(angle));
    auto crate = box({0.8, 0.8, 0.4}, {});
    crate.orientation = Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY());
    crate.position = {16 - 0.2 * std::sin(angle), 2, 16 * std::tan(angle) + 0.2 * std::cos(angle)};
    const auto id = bench.add(crate);
    const Eigen::Vector3f from = bench.position(id);
    bench.run(1.0);
    const double along = kGravity * std::max(0.0, std::sin(angle) - 0.5 * std::cos(angle));
    EXPECT_NEAR((bench.position(id) - from).norm(), 0.5 * along, 0.01 * along + 3e-3) << angle;
  }
}

TEST_P(Skin, BallRestsInValley) {
  // Two planes that meet in a line at the distance of a node from the ball's centre: two contacts.
  const double angle = 0.3;
  fixture.scene.materials[0].rolling_friction = 0.03;
  set_skin(fixture,
           {5, 17, 0, 0, [=](int, int column) { return std::tan(angle) * std::abs(column - 8); }, {}});
  const auto ball = fixture.add(sphere(1.0, {8.4, 2, 1.4}));
  fixture.run(6.0);
  EXPECT_NEAR(fixture.position(ball).x(), 8.0, 0.1);
  EXPECT_LT(fixture.velocity(ball).norm(), 0.05);
}

TEST_P(Skin, LiftsObjects) {
  set_skin(fixture, {8, 8, 0.8, 0.8, level, {.margin = 0.5}});
  const auto ball = fixture.add(sphere(0.6, {3.5, 3.5, 0.601}));
  const auto crate = fixture.add(box({1.5, 1.5, 1}, {1.5, 1.5, 0.501}));
  fixture.run(1.0);  // asleep
  for (float z = -10.0F; z < -7.0F; z += 0.02F) {
    raise_all(fixture, z);
    fixture.run(1.0 / 60);
  }
  raise_all(fixture, -7.0F);
  fixture.run(1.0);
  EXPECT_NEAR(fixture.position(ball).z(), 3.6, 0.02);
  EXPECT_NEAR(fixture.position(crate).z(), 3.5, 0.02);
}

namespace {

scene::SkinSpec elastic(double tension, double density) {
  // The damping settles what swings with 5 rad/s or more.
  return {.kind = scene::SkinSpec::Kind::kElastic,
          .margin = 0.5,
          .tension = tension,
          .density = density,
          .damping = 0.4 * tension};
}
bool is_in_first_or_last(int column, int count) { return column == 0 || column == count - 1; }

class ElasticSkin : public Skin {};
INSTANTIATE_TEST_SUITE_P(Steps, ElasticSkin, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

}  // namespace

TEST_P(ElasticSkin, StripSagsAsParabolaUnderItsWeight) {
  // z = −ρ·g·s·(L − s)/2T, held over the inner nodes of the lines of supports.
  const double tension = 50, density = 0.5, length = 7.75;
  SkinCase strip{2, 9, 0.25, 1.0, level, elastic(tension, density)};
  strip.has_cell = [](int, int column) { return is_in_first_or_last(column, 9); };
  strip.skin.attached = true;
  set_skin(fixture, strip);
  fixture.run(5.0);
  for (const double s : {0.5, 2.0, 3.875, 6.0}) {
    const double sag = density * kGravity * s * (length - s) / (2 * tension);
    EXPECT_NEAR(height_at(fixture, 0.125 + s, 0.5), -sag, 0.01 * sag) << s;
  }
}

TEST_P(ElasticSkin, RestsOnSupportsThatItReaches) {
  // Over supports at 1, 0 and 1, four pitches apart, it hangs free as long as it sags by less than 1.
  for (const double density : {0.4, 1.2}) {
    PhysicsFixture bench;
    bench.scene.world.dt_s = GetParam();
    const double tension = 50, sag = density * kGravity * 7.75 * 7.75 / (8 * tension);
    SkinCase strip{
        2, 9, 0.25, 1.0, [](int, int column) { return column == 4 ? 0.0 : 1.0; }, elastic(tension, density)};
    strip.has_cell = [](int, int column) { return column % 4 == 0; };
    set_skin(bench, strip);
    bench.run(6.0);
    EXPECT_NEAR(height_at(bench, 4.0, 0.5), std::max(0.0, 1.0 - sag), 0.01) << density;
    EXPECT_NEAR(height_at(bench, 0.0, 0.5), 1.0, 1e-6);
  }
}

TEST_P(ElasticSkin, PointLoadDipsAsLogarithm) {
  // z(r₂) − z(r₁) = F/(2πT)·ln(r₂/r₁), far from the clamped edge.
  const double tension = 100, weight = 20;
  SkinCase frame{17, 17, 0.25, 0.25, level, elastic(tension, 0.01), 3};
  frame.has_cell = [](int row, int column) { return row == 0 && column == 0; };
  frame.skin.edge = scene::SkinSpec::Edge::kClamped;
  set_skin(fixture, frame);
  auto ball = sphere(0.2, {8, 8, 0.2});
  ball.mass = weight / kGravity;
  const auto id = fixture.add(ball);
  fixture.run(2.5);
  EXPECT_LT(fixture.velocity(id).norm(), 0.01);
  EXPECT_NEAR(load_on(fixture), weight, 0.01 * weight);
  const double rise = height_at(fixture, 10, 8) - height_at(fixture, 9, 8),
               own_weight = 0.01 * kGravity * 3 / (4 * tension);
  EXPECT_NEAR(rise, weight / (2 * M_PI * tension) * std::log(2.0) + own_weight, 0.02 * rise);
}

TEST_P(ElasticSkin, BallRestsInItsDip) {
  set_skin(fixture, {6, 6, 0.25, 0.25, level, elastic(100, 0.1)});
  auto ball = sphere(0.6, {2.5, 2.5, 0.7});
  ball.mass = 3.0;
  const auto id = fixture.add(ball);
  fixture.run(2.0);
  EXPECT_LT(fixture.velocity(id).norm(), 0.02);
  EXPECT_NEAR(load_on(fixture), 3.0 * kGravity, 0.01 * 3.0 * kGravity);
  // The normal impulses of the contacts, which are oblique in the dip.
  const std::vector<float>& on_cells = fixture.cells().field().impulse;
  const double normal_load = std::accumulate(on_cells.begin(), on_cells.end(), 0.0) / GetParam();
  EXPECT_GT(normal_load, 0.99 * 3.0 * kGravity);
  EXPECT_LT(normal_load, 1.1 * 3.0 * kGravity);
  EXPECT_LT(fixture.position(id).z(), 0.55);
  EXPECT_NEAR(
      fixture.position(id).z() - height_at(fixture, fixture.position(id).x(), fixture.position(id).y()), 0.6,
      0.01);
}

TEST_P(ElasticSkin, BallRollsDownTautRamp) {
  // A skin so taut that its dip hardly matters.
  const double angle = 0.15, radius = 0.3;
  SkinCase setup = ramp(angle);
  setup.skin = elastic(1e5, 0.1);
  setup.skin.margin = 0.0;
  setup.skin.attached = true;
  setup.nodes_per_pitch = 4;
  set_skin(fixture, setup);
  const double x = 18.0, along = 5.0 / 7.0 * kGravity * std::sin(angle);
  auto ball = sphere(radius, Eigen::Vector3d(x - radius * std::sin(angle), 2.3,
                                             x * std::tan(angle) + radius * std::cos(angle)));
  ball.mass = 0.1;
  const auto id = fixture.add(ball);
  const Eigen::Vector3f from = fixture.position(id);
  fixture.run(2.0);
  EXPECT_NEAR((fixture.position(id) - from).norm(), 2.0 * along, 0.02 * 2.0 * along);
}

TEST_P(ElasticSkin, BearsManyObjectsOnLightSheet) {
  set_skin(fixture, {8, 8, 0.25, 0.25, level, elastic(200, 0.01), 4});
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d at(1.0 + 1.3 * (i % 5), 2.0 + 2.5 * (i / 5), 1.0);
    fixture.add(i % 2 == 0 ? sphere(0.4, at) : box({0.8, 0.8, 0.6}, at));
  }
  fixture.run(3.0);
  for (scene::ObjectId id = 0; id < 10; ++id) {
    EXPECT_GT(fixture.position(id).z(), 0.0) << id;
    EXPECT_LT(fixture.velocity(id).norm(), 0.3) << id;
  }
}

TEST(SkinState, HasTheSameBitsForAnyPitch) {
  // In world units of one pitch, a scene scaled by 1/16 is the same scene.
  const auto drop = [](double pitch) {
    PhysicsFixture fixture;
    set_skin(fixture, {6,
                       6,
                       0.25,
                       0.25,
                       [](int row, int column) { return 0.2 * ((row + 2 * column) % 3); },
                       {.margin = 0.5}});
    scene::SurfaceSpec& surface = fixture.scene.surface;
    surface.pitch *= pitch;
    surface.skin->margin *= pitch;
    fixture.scene.world.gravity *= pitch;
    for (float& base : surface.base_heights) base *= static_cast<float>(pitch);
    for (const char* length : {"top", "range", "max_speed", "max_acceleration", "length"})
      for (double& value : surface.actuators[0].values[length]) value *= pitch;
    derive_pin_spec(surface);
    auto ball = sphere(0.5 * pitch, {2.6 * pitch, 2.4 * pitch, 2 * pitch});
    ball.mass = 1.0;
    const auto id = fixture.add(ball);
    fixture.run(1.0);
    return Eigen::Vector3f(fixture.position(id) / static_cast<float>(pitch));
  };
  EXPECT_EQ(drop(1.0), drop(0.0625));
}

// A square sheet, clamped at its edge and held by next to nothing else, falls from the level.
TEST_P(ElasticSkin, SwingsAsDampedMembrane) {
  constexpr int kSheetSide = 8;
  for (unsigned seed = 1; seed <= (GetParam() < 2e-3 ? 2U : 5U); ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    const double density = uniform(0.05, 2), frequency = uniform(3, 12), decay = uniform(0.001, 0.3);
    const double tension = density * frequency * frequency * kSheetSide * kSheetSide / (2 * M_PI * M_PI);
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    SkinCase sheet{kSheetSide, kSheetSide, 0.1, 0.1, level, elastic(tension, density), 4};
    sheet.skin.edge = scene::SkinSpec::Edge::kClamped;
    sheet.skin.damping = 2 * decay / (frequency * frequency) * tension;
    sheet.skin.attached = true;
    sheet.has_cell = [](int row, int column) {
      return is_in_first_or_last(row, kSheetSide) && is_in_first_or_last(column, kSheetSide);
    };
    set_skin(fixture, sheet);
    Swing swing(GetParam());
    // The other modes vanish in the sum.
    fixture.run(20 * M_PI / frequency, [&] {
      double sum = 0.0;
      for (int r = 0; r < kSheetSide; ++r)
        for (int c = 0; c < kSheetSide; ++c)
          sum += std::sin(M_PI * (r + 0.5) / kSheetSide) * std::sin(M_PI * (c + 0.5) / kSheetSide) *
                 static_cast<double>(height_at(fixture, c, r));
      swing.add(sum);
    });
    EXPECT_NEAR(swing.period_s(), 2 * M_PI / frequency, 0.015 * 2 * M_PI / frequency);
    EXPECT_NEAR(swing.decrement() / swing.period_s(), decay, 0.03 * decay + 1e-3);
  }
}

namespace {

double draw(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

// A body of a random kind, upright, its lowest point at `low`.
scene::ObjectSpec random_body(std::mt19937& random, unsigned kind, double x, double y, double low) {
  const double r = draw(random, 0.6, 1.0), h = draw(random, 0.6, 1.2);
  switch (kind % 4) {
    case 0:
      return cylinder(r, h, {x, y, low + h / 2});
    case 1:
      return box({2 * r, 1.6 * r, h}, {x, y, low + h / 2});
    case 2:
      return sphere(r, {x, y, low + r});
    default:
      return cone(r, h, {x, y, low + h / 4});
  }
}

// An elastic skin that is clamped 2 u above the pins' tops.
void set_trampoline(PhysicsFixture& fixture, int side) {
  scene::SkinSpec skin = elastic(100, 0.02);
  skin.edge = scene::SkinSpec::Edge::kClamped;
  skin.edge_height = 2.0;
  skin.damping = 5;
  set_skin(fixture, {side, side, 0.8, 0.8, level, skin});
}

}  // namespace

TEST(SkinRest, DepthIsThatOfAnyStep) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    std::vector<double> depths;
    for (const double dt_s : {1.0 / 60, 1.0 / 240, 1.0 / 960}) {
      if (seed > 0 && dt_s < 2e-3) continue;
      SCOPED_TRACE(testing::Message() << seed << ", " << dt_s << " s");
      std::mt19937 random(seed);
      PhysicsFixture fixture;
      fixture.scene.world.dt_s = dt_s;
      fixture.scene.materials[0].rolling_friction = 0.03;
      set_trampoline(fixture, 6);
      auto body = random_body(random, seed, 2.5, 2.5, 2.0);
      body.mass = draw(random, 0.5, 3);
      const auto id = fixture.add(body);
      fixture.run(4.0);
      const double weight = kGravity * *body.mass;
      double load = 0.0, squared_speed = 0.0;
      int steps = 0;
      fixture.run(0.5, [&] {
        load += load_on(fixture), squared_speed += std::pow(fixture.velocity(id).z(), 2);
        ++steps;
      });
      EXPECT_NEAR(load / steps, weight, 0.01 * weight);
      EXPECT_LT(std::sqrt(squared_speed / steps), 0.01);
      depths.push_back(body.position.z() - static_cast<double>(fixture.position(id).z()));
    }
    const auto [least, greatest] = std::ranges::minmax(depths);
    EXPECT_GT(least, 0.02) << seed;
    EXPECT_LT(greatest - least, 0.15 * greatest) << seed;
  }
}

TEST_P(ElasticSkin, HeavyBodiesStayAboveThePins) {
  for (unsigned seed = 0; seed < (GetParam() < 2e-3 ? 1U : 8U); ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    set_trampoline(fixture, 8);
    auto body =
        random_body(random, seed, draw(random, 2.5, 4.5), draw(random, 2.5, 4.5), 2.0 + draw(random, 0, 8));
    body.mass = draw(random, 10, 40);
    const auto id = fixture.add(body);
    float lowest = 10.0F;
    fixture.run(2.0, [&] { lowest = std::min(lowest, fixture.position(id).z()); });
    EXPECT_GT(lowest, 0.1F);  // of the centre
  }
}

TEST_P(Skin, MovingTerrainKeepsBodiesAbove) {
  if (GetParam() < 2e-3) GTEST_SKIP() << "the coarser steps are the harder ones";
  constexpr int kSide = 11, kMoves = 12;
  for (unsigned seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    fixture = PhysicsFixture();
    fixture.scene.world.dt_s = GetParam();
    scene::SkinSpec skin{.margin = 1.0};
    if (seed % 2 == 1) skin = elastic(1000, 0.1), skin.margin = 1.0, skin.attached = true;
    set_skin(fixture, {kSide, kSide, 0.8, 0.8, level, skin});
    std::vector<scene::ObjectId> ids;
    for (unsigned i = 0; i < 9; ++i)
      ids.push_back(
          fixture.add(random_body(random, i + seed / 2, 2.5 + 2.5 * (i % 3), 2.5 + 2.5 * (i / 3), 3.0)));
    float deepest = 0.0F;
    for (int move = 0; move < kMoves; ++move) {
      double x[3], y[3], phase[3];
      for (int k = 0; k < 3; ++k)
        x[k] = draw(random, -0.9, 0.9), y[k] = draw(random, -0.9, 0.9), phase[k] = draw(random, 0, 2 * M_PI);
      for (int r = 0; r < kSide; ++r)
        for (int c = 0; c < kSide; ++c) {
          double z = -8.5;
          for (int k = 0; k < 3; ++k) z += 1.4 / 3 * std::sin(x[k] * c + y[k] * r + phase[k]);
          fixture.cells().set_target(0, r, c, static_cast<float>(z));
        }
      fixture.run(2.0 / 3, [&] {
        for (const auto id : ids) {
          const Eigen::Vector3f p = fixture.position(id);
          if (std::min(p.x(), p.y()) > 0.6F && std::max(p.x(), p.y()) < kSide - 1.6F)
            deepest = std::max(deepest, height_at(fixture, p.x(), p.y()) - p.z());
        }
      });
    }
    EXPECT_LT(deepest, 0.02F);  // the centres are in the bodies
  }
}
