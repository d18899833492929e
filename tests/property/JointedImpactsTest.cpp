// Impacts of bodies with joints: a blow to one of them moves all that joints connect with it, at once.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using scene::JointKind;

namespace {

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Bodies that do not turn yet, with joints between them, and their response to impulses on points: the dense
// equations of Lagrange's multipliers.
struct Mechanism {
  struct Body {
    scene::ObjectSpec spec;
    Vector3d moments;  // about the axes of the world
    scene::ObjectId id = 0;
  };
  struct Joint {
    JointKind kind;
    int a, b;
    Vector3d anchor, axis;
    int way_off_limit = 0;  // the sign of the speed with which it leaves the limit at which it is; 0: none
  };
  // What blows do: changes of (v, ω) of all bodies, and impulses along the rows of joints, by unit impulses
  // along the world's axes on a point of a body.
  struct Response {
    MatrixXd change, joints;
  };
  std::vector<Body> bodies;
  std::vector<Joint> joints;

  // The rows along which the joints forbid velocities, by (v, ω) of each body; last those of the joints of a
  // bit mask that their limits stop.
  MatrixXd forbidden(unsigned stopped) const {
    std::vector<VectorXd> rows;
    for (const Joint& j : joints) {
      const Vector3d x = j.axis.unitOrthogonal(), y = j.axis.cross(x);
      const auto add = [&](const Vector3d& linear, const Vector3d& turn) {
        VectorXd row = VectorXd::Zero(6 * std::ssize(bodies));
        for (const auto& [body, sign] : {std::pair(j.a, 1.0), std::pair(j.b, -1.0)}) {
          row.segment<3>(6 * body) = sign * linear;
          row.segment<3>(6 * body + 3) =
              sign * ((j.anchor - bodies[body].spec.position).cross(linear) + turn);
        }
        rows.push_back(row);
      };
      for (const Vector3d& n : {x, y}) add(n, Vector3d::Zero());
      if (j.kind != JointKind::kSlider) add(j.axis, Vector3d::Zero());
      if (j.kind == JointKind::kBall) continue;
      for (const Vector3d& n : {x, y}) add(Vector3d::Zero(), n);
      if (j.kind != JointKind::kHinge) add(Vector3d::Zero(), j.axis);
    }
    for (std::size_t k = 0; k < joints.size(); ++k)
      if ((stopped >> k & 1U) != 0) rows.push_back(axis_row(joints[k]));
    MatrixXd matrix(rows.size(), 6 * std::ssize(bodies));
    for (std::size_t i = 0; i < rows.size(); ++i) matrix.row(static_cast<Eigen::Index>(i)) = rows[i];
    return matrix;
  }
  // Along which the coordinate of a hinge or slider moves.
  VectorXd axis_row(const Joint& j) const {
    VectorXd row = VectorXd::Zero(6 * std::ssize(bodies));
    for (const auto& [body, sign] : {std::pair(j.a, 1.0), std::pair(j.b, -1.0)}) {
      if (j.kind == JointKind::kSlider) {
        row.segment<3>(6 * body) = sign * j.axis;
        row.segment<3>(6 * body + 3) = sign * (j.anchor - bodies[body].spec.position).cross(j.axis);
      } else {
        row.segment<3>(6 * body + 3) = sign * j.axis;
      }
    }
    return row;
  }
  Response response(int body, const Vector3d& point, unsigned stopped) const {
    const MatrixXd rows = forbidden(stopped);
    const auto n = 6 * std::ssize(bodies), m = rows.rows();
    MatrixXd matrix = MatrixXd::Zero(n + m, n + m), right = MatrixXd::Zero(n + m, 3);
    for (Eigen::Index i = 0; i < std::ssize(bodies); ++i) {
      const Body& b = bodies[static_cast<std::size_t>(i)];
      matrix.diagonal().segment<3>(6 * i).setConstant(*b.spec.mass);
      matrix.diagonal().segment<3>(6 * i + 3) = b.moments;
    }
    matrix.topRightCorner(n, m) = rows.transpose();
    matrix.bottomLeftCorner(m, n) = rows;
    right.middleRows<3>(6 * body).setIdentity();
    right.middleRows<3>(6 * body + 3) = cross_matrix(point - bodies[body].spec.position);
    const MatrixXd solution = matrix.fullPivLu().solve(right);
    return {solution.topRows(n), -solution.bottomRows(m)};
  }
  // Whether limits stop the joints of the mask, and no others, in the blow.
  bool stops_are(unsigned stopped, const VectorXd& change, const VectorXd& impulses) const {
    Eigen::Index row = impulses.size() - std::popcount(stopped);
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const Joint& j = joints[k];
      const bool is_stopped = (stopped >> k & 1U) != 0;
      if (is_stopped && (j.way_off_limit == 0 || j.way_off_limit * impulses[row++] < 0)) return false;
      if (!is_stopped && j.way_off_limit * axis_row(j).dot(change) < 0) return false;
    }
    return true;
  }
};

std::optional<scene::JointLimits> limits_of(const Mechanism::Joint& j) {
  if (j.way_off_limit == 0) return std::nullopt;
  return j.way_off_limit > 0 ? scene::JointLimits{0, 1} : scene::JointLimits{-1, 0};
}

// A ball with two to five boxes and balls above it, each with a joint to one before it.
template <class Draw>
Mechanism draw_mechanism(Draw draw) {
  Mechanism m;
  const auto add = [&](bool is_ball, const Vector3d& at) {
    const double radius = draw(0.2, 0.6), mass = std::pow(10.0, draw(-1, 1));
    Vector3d size(0, 0, 0);
    for (double& s : size) s = draw(0.4, 1.2);
    scene::ObjectSpec spec = is_ball ? sphere(radius, at) : box(size, at);
    spec.mass = mass;
    const Vector3d squares = size.cwiseAbs2();
    const Vector3d moments = is_ball ? Vector3d(Vector3d::Constant(0.4 * mass * radius * radius))
                                     : Vector3d(mass / 12 * (Vector3d::Constant(squares.sum()) - squares));
    m.bodies.push_back({spec, moments});
  };
  add(true, {15, 15, 2});
  const int others = 2 + static_cast<int>(draw(0, 4));
  for (int i = 1; i < others; ++i) {
    const int to = static_cast<int>(draw(0, i));
    Vector3d way(0, 0, 0);
    way.x() = draw(-1.2, 1.2), way.y() = draw(-1.2, 1.2), way.z() = 2.1 * (i - to);
    add(draw(0, 1) < 0.5, m.bodies[to].spec.position + way);
    Vector3d axis(0, 0, 0);
    for (double& a : axis) a = draw(-1, 1);
    const auto kind = static_cast<JointKind>(static_cast<int>(draw(0, 4)));
    const bool has_axis = kind == JointKind::kHinge || kind == JointKind::kSlider;
    const double limit = draw(-1, 1);
    m.joints.push_back({kind, i, to, 0.5 * (m.bodies[i].spec.position + m.bodies[to].spec.position),
                        axis.normalized(),
                        !has_axis      ? 0
                        : limit > 0.4  ? 1
                        : limit < -0.4 ? -1
                                       : 0});
  }
  return m;
}

class JointedImpacts : public testing::TestWithParam<double> {};

// The ball hits level cells or a fixed box: all velocities are those of the blow that Newton's law of impact
// demands at the point, without friction or with as much as stops the point. Joints at a limit are stopped.
TEST_P(JointedImpacts, BlowsPassThroughJoints) {
  int sticking = 0, with_stops = 0;
  for_random_fixtures(71, 60, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    Mechanism m = draw_mechanism(draw);
    const double e = draw(0.1, 1), friction = draw(0, 1) < 0.5 ? 0.0 : 2.0, fall = draw(1, 4);
    const bool on_box = draw(0, 1) < 0.5;
    fixture.scene.world.gravity = {0, 0, 0};
    fixture.scene.materials[0].restitution = e;
    fixture.scene.materials[0].friction = friction;
    Vector3d velocity(0, 0, -fall);
    velocity.x() = draw(-1, 1), velocity.y() = draw(-1, 1);
    const double lift = on_box ? 1.0 : 0.0;
    if (on_box) {
      auto anvil = box({6, 6, 1}, {15, 15, 0.5});
      anvil.fixed = true;
      fixture.add(anvil);
    }
    const double radius = m.bodies[0].spec.radius;
    const double drop = 2 - radius;
    for (Mechanism::Body& b : m.bodies) {
      b.spec.velocity = velocity;
      auto spec = b.spec;
      spec.position.z() += lift;
      b.id = fixture.add(spec);
    }
    std::vector<Vector3d> passed_on(m.bodies.size(), Vector3d::Zero());  // by each body to those above it
    std::vector<scene::JointId> ids;
    for (const Mechanism::Joint& j : m.joints)
      ids.push_back(fixture.world().add_joint({.kind = j.kind,
                                               .a = m.bodies[j.a].id,
                                               .b = m.bodies[j.b].id,
                                               .anchor = j.anchor + lift * Vector3d::UnitZ(),
                                               .axis = j.axis,
                                               .limits = limits_of(j)}));
    Vector3d impulse;
    VectorXd change;
    for (unsigned stopped = 0;; ++stopped) {
      ASSERT_LT(stopped, 1U << m.joints.size());
      if (std::popcount(stopped) > 0 && !std::ranges::all_of(m.joints, [&](const Mechanism::Joint& j) {
            return j.way_off_limit != 0 || (stopped >> (&j - m.joints.data()) & 1U) == 0;
          }))
        continue;
      const Mechanism::Response r =
          m.response(0, m.bodies[0].spec.position - radius * Vector3d::UnitZ(), stopped);
      const Matrix3d at_point =
          r.change.topRows<3>() + cross_matrix(radius * Vector3d::UnitZ()) * r.change.middleRows<3>(3);
      impulse = Vector3d(0, 0, (1 + e) * fall / at_point(2, 2));
      if (friction > 0) impulse = at_point.inverse() * Vector3d(-velocity.x(), -velocity.y(), (1 + e) * fall);
      change = r.change * impulse;
      if (!m.stops_are(stopped, change, r.joints * impulse)) continue;
      if (stopped != 0) ++with_stops;
      break;
    }
    if (friction > 0) {
      if (impulse.head<2>().norm() > 0.95 * friction * impulse.z()) return;
      ++sticking;
    }
    const double until = drop / fall;
    const int steps = static_cast<int>(std::ceil(until / fixture.scene.world.dt_s + 1e-4));
    fixture.run(steps * fixture.scene.world.dt_s);
    SCOPED_TRACE(testing::Message() << "e " << e << ", friction " << friction << ", bodies "
                                    << m.bodies.size() << (on_box ? ", on a box" : ""));
    for (std::size_t i = m.bodies.size(); i-- > 0;) {
      const auto at = static_cast<Eigen::Index>(6 * i);
      const Vector3d expected = velocity + change.segment<3>(at), turn = change.segment<3>(at + 3);
      EXPECT_LT((fixture.velocity(m.bodies[i].id).cast<double>() - expected).norm(), 0.003 * fall) << i;
      EXPECT_LT((fixture.angular_velocity(m.bodies[i].id).cast<double>() - turn).norm(),
                0.003 * (fall + turn.norm()))
          << i;
      if (i == 0) continue;
      const scene::JointState state = fixture.world().joint_state(ids[i - 1]);
      Vector3d force = state.force;
      if (m.joints[i - 1].kind == JointKind::kSlider) force += state.effort * m.joints[i - 1].axis;
      const Vector3d reported = fixture.scene.world.dt_s * force - passed_on[i];
      EXPECT_LT((reported - *m.bodies[i].spec.mass * change.segment<3>(at)).norm(), 0.01 * impulse.norm())
          << i;
      passed_on[static_cast<std::size_t>(m.joints[i - 1].b)] += reported + passed_on[i];
    }
  });
  EXPECT_GT(sticking, 10);
  EXPECT_GT(with_stops, 10);
}

// Columns of two to eight welded boxes fall flat onto level cells, and rebound as one box would.
TEST_P(JointedImpacts, WeldedColumnsRebound) {
  for_random_fixtures(72, 12, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const int count = 2 + static_cast<int>(draw(0, 7));
    const double e = draw(0.2, 0.9), drop = draw(0.5, 2);
    fixture.scene.materials[0].restitution = e;
    double z = drop;
    scene::ObjectId last = 0;
    for (int i = 0; i < count; ++i) {
      const double height = draw(0.3, 1), mass = std::pow(10.0, draw(-1, 1));
      auto o = box({3, 3, height}, {15.5, 15.5, z + 0.5 * height});
      o.mass = mass;
      const auto id = fixture.add(o);
      if (i > 0)
        fixture.world().add_joint({.kind = JointKind::kFixed, .a = id, .b = last, .anchor = {15.5, 15.5, z}});
      last = id;
      z += height;
    }
    const double top = fixture.position(last).z();
    bool rises = false;
    double apex = -1e9;
    fixture.run(1.0 + std::sqrt(2 * drop / kGravity), [&] {
      rises |= fixture.velocity(last).z() > 0.1F;
      if (rises) apex = std::max(apex, static_cast<double>(fixture.position(last).z()));
    });
    EXPECT_NEAR((apex - top + drop) / drop, e * e, 0.03) << count << " boxes, e " << e << ", from " << drop;
  });
}

// Two mechanisms meet in free space, with friction and limits, or without them and elastically.
TEST_P(JointedImpacts, CollisionsKeepMomentumAndEnergy) {
  for_random_fixtures(73, 60, GetParam(), [&](PhysicsFixture& fixture, auto draw) {
    const double e = draw(0, 1) < 0.5 ? 1.0 : draw(0, 1), speed = draw(1, 5);
    fixture.scene.world.gravity = {0, 0, 0};
    fixture.scene.materials[0].restitution = e;
    fixture.scene.materials[0].friction = e == 1.0 ? 0.0 : draw(0, 1);
    Mechanism both[2] = {draw_mechanism(draw), draw_mechanism(draw)};
    for (int k = 0; k < 2; ++k) {
      Vector3d shift(0, 0, 30);
      shift.x() = draw(-0.3, 0.3), shift.y() = draw(-0.3, 0.3);
      for (Mechanism::Body& b : both[k].bodies) {
        Vector3d at = b.spec.position;
        if (k == 1) at.z() = 4 - at.z() - 2.5;
        b.spec.position = at + shift;
        b.spec.velocity = Vector3d(0, 0, k == 0 ? -speed : speed);
        b.id = fixture.add(b.spec);
      }
      for (const Mechanism::Joint& j : both[k].joints) {
        Vector3d anchor = 0.5 * (both[k].bodies[j.a].spec.position + both[k].bodies[j.b].spec.position);
        fixture.world().add_joint({.kind = j.kind,
                                   .a = both[k].bodies[j.a].id,
                                   .b = both[k].bodies[j.b].id,
                                   .anchor = anchor,
                                   .axis = j.axis,
                                   .limits = e == 1.0 ? std::nullopt : limits_of(j)});
      }
    }
    const auto sums = [&] {  // linear and angular momentum, energy
      Eigen::Matrix<double, 7, 1> sum = Eigen::Matrix<double, 7, 1>::Zero();
      for (const Mechanism& m : both)
        for (const Mechanism::Body& b : m.bodies) {
          const double mass = *b.spec.mass;
          const Vector3d v = fixture.velocity(b.id).cast<double>(),
                         spin = fixture.angular_velocity(b.id).cast<double>(),
                         arm = fixture.position(b.id).cast<double>() - Vector3d(15, 15, 31);
          const Eigen::Quaterniond q = fixture.world().state(b.id).orientation;
          const Vector3d own = q * Vector3d(b.moments.cwiseProduct(Vector3d(q.conjugate() * spin)));
          sum.head<3>() += mass * v;
          sum.segment<3>(3) += mass * arm.cross(v) + own;
          sum[6] += 0.5 * (mass * v.squaredNorm() + spin.dot(own));
        }
      return sum;
    };
    const Eigen::Matrix<double, 7, 1> before = sums();
    const double dt_s = fixture.scene.world.dt_s;
    const auto is_struck = [&] {
      return std::ranges::any_of(both[0].bodies, [&](const Mechanism::Body& b) {
        return (fixture.velocity(b.id).cast<double>() - b.spec.velocity).norm() > 1e-3 * speed;
      });
    };
    // Not longer: bodies that fly along a slider as it turns gain some.
    for (double t = 0; t < 1.0 && !is_struck(); t += dt_s) fixture.run(dt_s);
    const Eigen::Matrix<double, 7, 1> after = sums();
    const double energy = before[6], momentum = std::sqrt(2 * energy);  // of a mass of 1
    SCOPED_TRACE(testing::Message() << "e " << e << ", at " << speed << " u/s");
    EXPECT_LT(after[6], 1.001 * energy);
    if (e == 1.0) EXPECT_GT(after[6], 0.999 * energy);
    EXPECT_LT((after - before).head<3>().norm(), 0.001 * momentum);
    EXPECT_LT((after - before).segment<3>(3).norm(), 10 * dt_s * momentum);
  });
}

INSTANTIATE_TEST_SUITE_P(Steps, JointedImpacts, testing::Values(1.0 / 60, 1.0 / 240, 1.0 / 960));

}  // namespace
