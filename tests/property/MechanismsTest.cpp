// Mechanisms of several bodies against closed forms, drawn from a seed: grooves, rollers, levers, linkages,
// wedges, plates with frictions of their own.
//
// MECHANISM_SEEDS: how many of each; MECHANISM_REPORT: prints the errors; PHYSICS_ENGINE=bullet: on Bullet.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

namespace {

struct Value {
  const char* name;
  double measured, right, tolerance;
};
using Values = std::vector<Value>;

const Vector3d kAt(15.5, 15.5, 20);  // above the table

struct Draw {
  Draw(unsigned seed, double rate, int iterations) : random(seed) {
    fixture.scene.world.dt_s = 1.0 / rate;
    fixture.scene.world.iterations = iterations;
  }
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  // A body that rests on nothing else keeps its place.
  scene::ObjectId add(scene::ObjectSpec o, double mass,
                      const Quaterniond& orientation = Quaterniond::Identity()) {
    o.mass = mass, o.orientation = orientation;
    return fixture.add(o);
  }
  scene::ObjectId add_fixed(scene::ObjectSpec o, double friction,
                            const Quaterniond& orientation = Quaterniond::Identity()) {
    o.fixed = true, o.friction = friction, o.orientation = orientation;
    return fixture.add(o);
  }
  void hinge(scene::ObjectId a, std::optional<scene::ObjectId> b, const Vector3d& at) {
    fixture.world().add_joint(
        {.kind = scene::JointKind::kHinge, .a = a, .b = b, .anchor = at, .axis = Vector3d::UnitY()});
  }
  Vector3d position(scene::ObjectId id) { return fixture.position(id).cast<double>(); }
  double dt_s() const { return fixture.scene.world.dt_s; }

  PhysicsFixture fixture;
  std::mt19937 random;
};

Quaterniond turned(double angle, const Vector3d& axis) { return Quaterniond(AngleAxisd(angle, axis)); }

// A box on its edge slides along a groove of 90°: its faces bear √2 times its weight.
Values groove(Draw& d) {
  const double friction = d(0.1, 0.3), speed = d(1, 3), side = d(0.5, 1);
  for (const double way : {-1.0, 1.0}) {
    const Vector3d up = Vector3d(0, way, 1).normalized(), inwards = Vector3d(0, -way, 1).normalized();
    d.add_fixed(box({24, 4, 0.5}, kAt + 2 * up - 0.25 * inwards), friction,
                turned(way * M_PI / 4, Vector3d::UnitX()));
  }
  auto o = box({d(0.8, 2), side, side}, kAt + Vector3d(-8, 0, side / std::sqrt(2.0)));
  o.friction = friction, o.velocity = {speed, 0, 0};
  const auto id = d.add(o, d(0.5, 20), turned(M_PI / 4, Vector3d::UnitX()));
  const double right = speed * speed / (2 * friction * kGravity * std::sqrt(2.0));
  d.fixture.run(speed / (friction * kGravity) + 0.5);
  return {{"way", d.position(id).x() - kAt.x() + 8, right, 0.01 * right + 0.5 * speed * d.dt_s()},
          {"aside", d.position(id).y() - kAt.y(), 0, 0.005}};
}

// A plank on rollers that is pushed: each roller counts with three eighths of its mass.
Values rollers(Draw& d) {
  const int count = 2 + static_cast<int>(d(0, 3));
  const double radius = d(0.3, 0.6), mass = d(1, 10), plank = d(1, 10), acceleration = d(0.5, 1.5);
  d.add_fixed(box({24, 6, 1}, kAt - Vector3d(0, 0, 0.5)), 0.7);
  for (int i = 0; i < count; ++i) {
    auto o = cylinder(radius, 2, kAt + Vector3d(-6 + 4.0 * i / (count - 1), 0, radius));
    o.friction = 0.7;
    d.add(o, mass, turned(M_PI / 2, Vector3d::UnitX()));
  }
  auto o = box({8, 1.5, 0.3}, kAt + Vector3d(-4, 0, 2 * radius + 0.15));
  o.friction = 0.7;
  const auto id = d.add(o, plank);
  d.fixture.run(0.2);
  const double before = d.position(id).x();
  d.fixture.world().apply_force(id, {(plank + 0.375 * count * mass) * acceleration, 0, 0}, {}, 1.0);
  d.fixture.run(1.0);
  const double right = 0.5 * acceleration;
  return {{"way", d.position(id).x() - before, right, 0.01 * right + 0.5 * acceleration * d.dt_s()}};
}

// A plate with a hinge at one end that lies on a ball: the lever law. Friction would share the load in any
// way with the hinge.
Values hinged_plate(Draw& d) {
  const double length = d(2, 6), mass = d(1, 20), at = length * d(0.4, 0.95), radius = d(0.3, 0.6);
  d.add_fixed(sphere(radius, kAt + Vector3d(at, 0, -0.1 - radius)), 0.0);
  const auto plate = d.add(box({length, 1, 0.2}, kAt + Vector3d(length / 2, 0, 0)), mass);
  d.hinge(plate, {}, kAt);
  d.fixture.run(1.5);
  const double weight = mass * kGravity, right = weight * (1 - length / 2 / at);
  return {{"force of the hinge", d.fixture.world().joint_state(0).force.z(), right, 0.005 * weight},
          {"height", d.position(plate).z() - kAt.z(), 0, 0.003}};
}

// A ball falls onto the end of a lever: the angular momentum about the hinge is kept.
Values lever(Draw& d) {
  const double half = d(1.5, 3), mass = d(1, 10), ball = d(0.5, 5), radius = d(0.2, 0.4), fall = d(0.5, 2);
  const auto plank = d.add(box({2 * half, 0.8, 0.2}, kAt), mass);
  d.hinge(plank, {}, kAt);
  const double arm = half * d(0.6, 0.9);
  d.add(sphere(radius, kAt + Vector3d(arm, 0, 0.1 + radius + fall)), ball);
  const double time = std::sqrt(2 * fall / kGravity) + 2.5 * d.dt_s();
  d.fixture.run(time);
  const double inertia = mass / 12 * (4 * half * half + 0.04) + ball * arm * arm;
  const double right = ball * arm * std::sqrt(2 * kGravity * fall) / inertia,
               later = ball * arm * kGravity / inertia * 2.5 * d.dt_s();
  return {{"spin", d.fixture.angular_velocity(plank).y(), right + 0.5 * later, 0.02 * right + later}};
}

// Two cranks and a coupler, a parallelogram, swing as a pendulum.
Values four_bars(Draw& d) {
  const double length = d(1, 2), width = d(1.5, 3), crank = d(0.5, 3), coupler = d(0.5, 10),
               start = d(0.3, 1.0);
  const Vector3d along(std::sin(start), 0, -std::cos(start));
  std::vector<scene::ObjectId> cranks;
  for (const double x : {0.0, width}) {
    const Vector3d pivot = kAt + Vector3d(x, 0, 0);
    auto o = box({0.1, 0.1, length}, pivot + 0.5 * length * along);
    cranks.push_back(d.add(o, crank, turned(-start, Vector3d::UnitY())));
    d.hinge(cranks.back(), {}, pivot);
  }
  const auto bar = d.add(box({width, 0.1, 0.1}, kAt + length * along + Vector3d(width / 2, 0, 0)), coupler);
  d.hinge(bar, cranks[0], kAt + length * along);
  d.hinge(bar, cranks[1], kAt + length * along + Vector3d(width, 0, 0));
  const double inertia =
      2 * crank * ((length * length + 0.01) / 12 + length * length / 4) + coupler * length * length;
  const double torque = (crank + coupler) * length * kGravity;
  const long steps = std::lround(1.5 / d.dt_s());
  double angle = start, spin = 0;
  for (long i = 0; i < 100 * steps; ++i) {  // leapfrog
    spin -= torque / inertia * std::sin(angle) * d.dt_s() / 100;
    angle += spin * d.dt_s() / 100;
  }
  d.fixture.run(1.5);
  const Vector3d p = d.position(bar) - kAt - Vector3d(width / 2, 0, 0);
  return {{"east", p.x(), length * std::sin(angle), 0.01 * length + 2 * d.dt_s() * length * start},
          {"length", p.norm(), length, 0.001}};
}

// A box slides down a wedge that gives way, all without friction.
Values wedge_gives_way(Draw& d) {
  const double mass = d(0.5, 5), heavy = d(1, 10), side = d(0.2, 0.4), angle = M_PI / 3;
  d.add_fixed(box({24, 6, 1}, kAt - Vector3d(0, 0, 0.5)), 0.0);
  auto w = wedge(kAt + Vector3d(0, 0, 1 / std::sqrt(3.0)));
  w.friction = 0.0;
  const auto under = d.add(w, heavy);
  const Vector3d normal(std::sin(angle), 0, std::cos(angle)), down(std::cos(angle), 0, -std::sin(angle));
  auto o = box({side, side, side}, kAt + Vector3d(0, 0, std::sqrt(3.0)) + 0.4 * down + side / 2 * normal);
  o.friction = 0.0;
  d.add(o, mass, turned(angle, Vector3d::UnitY()));
  const double time = 0.3;
  d.fixture.run(time);
  const double sine = std::sin(angle), cosine = std::cos(angle);
  const double right = -0.5 * time * time * mass * kGravity * sine * cosine / (heavy + mass * sine * sine);
  return {{"way of the wedge", d.position(under).x() - kAt.x(), right,
           -0.01 * right - 2 * right / time * d.dt_s()}};
}

// A plate slides on another one, which slides without friction, until both have one speed.
Values plates(Draw& d) {
  const double of_upper = d(0.1, 0.9), of_lower = d(0.1, 0.9), upper = d(1, 10), lower = d(1, 10),
               speed = d(0.5, 2);
  d.add_fixed(box({30, 8, 1}, kAt - Vector3d(0, 0, 0.5)), 0.0);
  auto under = box({8, 4, 0.4}, kAt + Vector3d(-6, 0, 0.2)),
       on = box({1.5, 1.5, 0.3}, kAt + Vector3d(-8, 0, 0.55));
  under.friction = of_lower, on.friction = of_upper;
  on.velocity = {speed, 0, 0};
  const auto a = d.add(under, lower), b = d.add(on, upper);
  const double friction = std::sqrt(of_upper * of_lower), slowing = friction * kGravity * (1 + upper / lower);
  d.fixture.run(speed / slowing + 0.3);
  const double way = speed * speed / (2 * slowing), common = upper * speed / (upper + lower);
  return {{"way on the plate", d.position(b).x() - d.position(a).x() + 2, way,
           0.02 * way + 0.5 * speed * d.dt_s()},
          {"speed of the lower", d.fixture.velocity(a).x(), common, 0.003 * common + 0.002},
          {"speed of the upper", d.fixture.velocity(b).x(), common, 0.003 * common + 0.002}};
}

struct Mechanism {
  const char* name;
  Values (*run)(Draw&);
};
constexpr Mechanism kMechanisms[] = {
    {"Groove", groove}, {"Rollers", rollers},    {"HingedPlate", hinged_plate},
    {"Lever", lever},   {"FourBars", four_bars}, {"WedgeGivesWay", wedge_gives_way},
    {"Plates", plates}};

class Mechanisms : public testing::TestWithParam<Mechanism> {};

TEST_P(Mechanisms, ObeyTheirClosedForms) {
  const char* seeds = std::getenv("MECHANISM_SEEDS");
  for (unsigned seed = 1; seed <= static_cast<unsigned>(seeds ? std::atoi(seeds) : 2); ++seed)
    for (const double rate : {60.0, 120.0, 240.0, 960.0})
      for (const int iterations : {10, 40}) {
        Draw draw(seed, rate, iterations);
        for (const Value& v : GetParam().run(draw)) {
          const auto at = std::string(v.name) + ", seed " + std::to_string(seed) + ", 1/" +
                          std::to_string(static_cast<int>(rate)) + ", " + std::to_string(iterations) +
                          " iterations";
          if (std::getenv("MECHANISM_REPORT"))
            std::printf("%s %s: %.5f for %.5f, %.2f of the tolerance\n", GetParam().name, at.c_str(),
                        v.measured, v.right, std::abs(v.measured - v.right) / v.tolerance);
          EXPECT_NEAR(v.measured, v.right, v.tolerance) << at;
        }
      }
}
INSTANTIATE_TEST_SUITE_P(Drawn, Mechanisms, testing::ValuesIn(kMechanisms),
                         [](const auto& mechanism) { return std::string(mechanism.param.name); });

}  // namespace
