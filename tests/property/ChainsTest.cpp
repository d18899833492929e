// Chains whose links meet each other, the table and other bodies: they lose energy, come to rest, and no link
// passes through another.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "smartsurf/scene/Axes.h"
#include "tests/property/PhysicsFixture.h"

using namespace physics_fixture;
using namespace smartsurf;
using Eigen::Vector3d;

namespace {

// How a chain begins: as a bellows on a pivot, over the table, as a closed loop over the table, over a fixed
// bar, over bodies that lie on the table.
enum class Start { kHangs, kDrops, kLoop, kOverBar, kOnBodies };
constexpr const char* kNames[] = {"hangs", "drops", "loop", "over a bar", "over bodies"};

double distance_of_segments(const Vector3d& p, const Vector3d& d, const Vector3d& q, const Vector3d& e) {
  // p ± d, q ± e
  const Vector3d r = p - q;
  const double a = d.dot(d), b = d.dot(e), c = e.dot(e), f = d.dot(r), g = e.dot(r), det = a * c - b * b;
  double s = det > 1e-12 ? std::clamp((b * g - c * f) / det, -1.0, 1.0) : 0.0;
  double t = std::clamp((b * s + g) / c, -1.0, 1.0);
  s = std::clamp((b * t - f) / a, -1.0, 1.0);
  t = std::clamp((b * s + g) / c, -1.0, 1.0);
  return (r + s * d - t * e).norm();
}

class Chain {
 public:
  Chain(unsigned seed, double dt_s, int iterations) : random_(seed) {
    scene::SceneSpec& s = fixture_.scene;
    s.world.dt_s = dt_s;
    s.world.iterations = iterations;
    s.surface.rows = s.surface.columns = 24;
    s.materials[0].friction = uniform(0.2, 0.7);
    s.materials[0].rolling_friction = 0.05;
    start = static_cast<Start>(seed % 5);
    count = 2 + static_cast<int>(random_() % 29);
    if (start == Start::kLoop) count = std::max(count, 4);
    is_box_ = random_() % 2 == 0;
    is_hinged_ = random_() % 2 == 0;
    radius_ = uniform(0.05, 0.15);
    length_ = uniform(0.6, 1.2);
    mass_ = std::exp(uniform(-3, 2));
    build();
  }

  double greatest_growth = 0.0;  // of the energy above its least so far, of the weight times the length
  double least_gap = 1e9;        // of the axes of links that no joint connects, in thicknesses
  double last_speed = 0.0;       // greatest, in the last fifth of the time, u/s
  double strain = 0.0;           // greatest distance of two links at their joint, u
  Start start;
  int count;

  void run(double seconds) {
    double t = 0.0, least = 1e300;
    const double scale = count * mass_ * kGravity * length_ * count;
    int step = 0;
    fixture_.run(seconds, [&] {
      t += fixture_.scene.world.dt_s;
      const double e = energy();
      least = std::min(least, e);
      greatest_growth = std::max(greatest_growth, (e - least) / scale);
      if (++step % 4 == 0) look();
      if (t > 0.8 * seconds) last_speed = std::max(last_speed, speed());
    });
  }

 private:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }

  void add_link(const Vector3d& from, const Vector3d& to) {
    const Vector3d along = (to - from).normalized();
    auto o = is_box_ ? box({2 * radius_, 2 * radius_, length_}, 0.5 * (from + to))
                     : capsule(radius_, length_ + 2 * radius_, 0.5 * (from + to));
    o.mass = mass_;
    o.orientation = smartsurf::scene::rotation_between(Vector3d::UnitZ(), along);
    links_.push_back(fixture_.add(o));
  }
  void join(scene::ObjectId a, std::optional<scene::ObjectId> b, const Vector3d& at) {
    fixture_.world().add_joint({.kind = is_hinged_ ? scene::JointKind::kHinge : scene::JointKind::kBall,
                                .a = a,
                                .b = b,
                                .anchor = at,
                                .axis = Vector3d::UnitY()});
  }

  void build() {
    std::vector<Vector3d> corners;
    const Vector3d middle(11.5, 11.5, 0);
    Vector3d at = middle;
    const bool flat = is_hinged_;
    switch (start) {
      case Start::kHangs: {  // a bellows of folds, which stands on the pivot
        const double rise = std::asin(std::min(0.9, uniform(1.3, 4.0) * radius_ / length_));
        at.z() = count * length_ * uniform(0.4, 1.1);
        corners.push_back(at);
        for (int i = 0; i < count; ++i) {
          at += length_ * Vector3d(std::cos(rise) * (i % 2 == 0 ? 1 : -1), 0, std::sin(rise));
          corners.push_back(at);
        }
        break;
      }
      case Start::kDrops:
      case Start::kOverBar:
      case Start::kOnBodies:
        at.x() -= 0.5 * std::min(count, 18) * length_ * 0.8;
        at.z() = start == Start::kDrops ? uniform(0.5, 3) : 4.0;
        corners.push_back(at);
        for (int i = 0; i < count; ++i) {
          const double angle = uniform(0.0, 0.6) * (i % 2 == 0 ? 1 : -1);
          at += length_ * Vector3d(std::cos(angle) * (i / 18 % 2 ? -1 : 1), flat ? 0.0 : uniform(-0.3, 0.3),
                                   std::sin(angle) + (i % 18 == 17 ? 2.0 : 0.05))
                              .normalized();
          corners.push_back(at);
        }
        break;
      case Start::kLoop:
        at.z() = 0.0;
        for (int i = 0; i <= count; ++i) {
          const double r = 0.5 * length_ / std::sin(M_PI / count), angle = 2 * M_PI * i / count;
          corners.push_back(middle + Vector3d(r * std::cos(angle), flat ? 0.0 : r * std::sin(angle),
                                              flat ? r * std::sin(angle) + r + 1.0 : 1.0));
        }
        break;
    }
    if (start == Start::kOverBar) {
      auto bar = box({0.6, 8, 0.6}, {11.5 + uniform(-1, 1), 11.5, 2.5});
      bar.fixed = true;
      fixture_.add(bar);
    }
    if (start == Start::kOnBodies)
      for (int i = 0; i < 6; ++i) {
        auto o = i % 2 ? sphere(0.6, {4.0 + 3 * i, 11.5 + uniform(-0.5, 0.5), 0.6})
                       : box({1.2, 1.2, 1.2}, {4.0 + 3 * i, 11.5 + uniform(-0.5, 0.5), 0.6});
        o.mass = mass_ * std::exp(uniform(-1.5, 2.5));
        others_.push_back({fixture_.add(o), *o.mass, i % 2 != 0});
      }
    for (int i = 0; i < count; ++i) add_link(corners[i], corners[i + 1]);
    if (start == Start::kHangs) join(links_[0], std::nullopt, corners[0]);
    for (int i = 1; i < count; ++i) join(links_[i], links_[i - 1], corners[i]);
    if (start == Start::kLoop) join(links_[0], links_[count - 1], corners[0]);
  }

  double energy_of(scene::ObjectId id, double mass, const Vector3d& moments) {
    const auto s = fixture_.world().state(id);
    const Vector3d spin = s.orientation.conjugate() * s.angular_velocity;
    return mass * (0.5 * s.velocity.squaredNorm() + kGravity * s.position.z()) +
           0.5 * moments.dot(spin.cwiseAbs2());
  }
  double energy() {
    double sum = 0.0;
    Vector3d moments;
    if (is_box_) {
      const double w2 = 4 * radius_ * radius_, l2 = length_ * length_;
      moments = mass_ / 12 * Vector3d(w2 + l2, w2 + l2, 2 * w2);
    } else {
      const double r = radius_, l = length_, r2 = r * r, tube = M_PI * r2 * l, caps = 4.0 / 3 * M_PI * r2 * r;
      const double mt = mass_ * tube / (tube + caps), mc = mass_ - mt;
      const double across = mt * (l * l / 12 + r2 / 4) + mc * (0.4 * r2 + 0.25 * l * l + 0.375 * l * r);
      moments = {across, across, 0.5 * mt * r2 + 0.4 * mc * r2};
    }
    for (const auto id : links_) sum += energy_of(id, mass_, moments);
    for (const auto& o : others_)
      sum += energy_of(o.id, o.mass, o.mass * (o.is_sphere ? 0.4 * 0.36 : 1.44 / 6) * Vector3d::Ones());
    return sum;
  }
  double speed() {
    double v = 0.0;
    for (const auto id : links_) v = std::max<double>(v, fixture_.velocity(id).norm());
    return v;
  }
  void look() {
    std::vector<Vector3d> at, half;
    for (const auto id : links_) {
      const auto s = fixture_.world().state(id);
      at.push_back(s.position);
      half.push_back(0.5 * length_ * (s.orientation * Vector3d::UnitZ()));
    }
    for (int i = 0; i < count; ++i) {
      for (int k = i + 2; k < count; ++k) {
        if (start == Start::kLoop && i == 0 && k == count - 1) continue;
        least_gap = std::min(least_gap, distance_of_segments(at[i], half[i], at[k], half[k]) / (2 * radius_));
      }
      if (i + 1 < count) strain = std::max(strain, (at[i] + half[i] - at[i + 1] + half[i + 1]).norm());
    }
  }

  struct Other {
    scene::ObjectId id;
    double mass;
    bool is_sphere;
  };
  PhysicsFixture fixture_;
  std::mt19937 random_;
  std::vector<scene::ObjectId> links_;
  std::vector<Other> others_;
  bool is_box_, is_hinged_;
  double radius_, length_, mass_;
};

struct Bound {
  double rate;  // steps per second
  int iterations, seeds;
  double seconds, growth;
};

class Chains : public testing::TestWithParam<Bound> {};

}  // namespace

// CHAIN_SEEDS: how many scenes; CHAIN_FIRST: the first of them; CHAIN_SECONDS: how long; CHAIN_REPORT: prints
// them.
TEST_P(Chains, LoseEnergyAndStayApart) {
  const auto number = [](const char* name, double otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atof(text) : otherwise;
  };
  const Bound& bound = GetParam();
  const int first = static_cast<int>(number("CHAIN_FIRST", 1));
  for (int seed = first; seed < first + static_cast<int>(number("CHAIN_SEEDS", bound.seeds)); ++seed) {
    SCOPED_TRACE(seed);
    Chain chain(static_cast<unsigned>(seed), 1.0 / bound.rate, bound.iterations);
    chain.run(number("CHAIN_SECONDS", bound.seconds));
    if (std::getenv("CHAIN_REPORT")) {
      std::printf(
          "1/%.0f, %d iterations, seed %d, %s, %d links: energy +%.5f, gap %.3f, off the joints %.4f, last "
          "speed %.4f\n",
          bound.rate, bound.iterations, seed, kNames[static_cast<int>(chain.start)], chain.count,
          chain.greatest_growth, chain.least_gap, chain.strain, chain.last_speed);
      std::fflush(stdout);
    }
    // What a chain of thirty rods that whips freely is allowed (docs/truth.md).
    EXPECT_LT(chain.greatest_growth, bound.growth);
    EXPECT_GT(chain.least_gap, 0.3);
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, Chains,
                         testing::Values(Bound{60, 10, 6, 2.5, 0.005}, Bound{60, 4, 8, 2.5, 0.005},
                                         Bound{60, 80, 3, 1.0, 0.005}, Bound{120, 10, 3, 1.0, 0.005},
                                         Bound{240, 10, 3, 1.0, 0.005}, Bound{960, 10, 2, 0.3, 0.005}),
                         [](const auto& bound) {
                           return "At" + std::to_string(static_cast<int>(bound.param.rate)) + "With" +
                                  std::to_string(bound.param.iterations);
                         });

struct TautBound {
  double rate, growth;
};
class TautChains : public testing::TestWithParam<TautBound> {};

// A heap of links on the table comes to rest.
TEST(ChainsAtRest, HeapsComeToRest) {
  for (const unsigned seed : {1U, 7U}) {
    SCOPED_TRACE(seed);
    Chain chain(seed, 1.0 / 60, 10);
    chain.run(5.0);
    EXPECT_LT(chain.last_speed, 0.05);
  }
}

// A bellows of fifteen links that falls from its pivot and whips.
TEST(WhippingChain, LosesEnergy) {
  Chain chain(10, 1.0 / 60, 10);
  chain.run(1.5);
  EXPECT_LT(chain.greatest_growth, 0.005);
  EXPECT_GT(chain.least_gap, 0.3);
}

// A chain that is stretched out between two points, or hangs through by little, and a ball that falls onto it
// or lies on it: along the chain, nothing gives way. Energies of translation. TAUT_DRAWS draws more.
TEST_P(TautChains, GainNoEnergyFromWhatTouchesThem) {
  const char* const draws = std::getenv("TAUT_DRAWS");
  for_random_fixtures(
      3, draws ? std::atoi(draws) : 20, 1.0 / GetParam().rate, [](PhysicsFixture& fixture, auto draw) {
        scene::SceneSpec& s = fixture.scene;
        s.surface.rows = s.surface.columns = 24;
        const int count = static_cast<int>(draw(2, 8));
        const bool is_hinged = draw(0, 1) < 0.5;
        const double length = draw(1, 2), sag = draw(0, 1) < 0.3 ? 0.0 : std::pow(10.0, draw(-4, -1.3)),
                     mass = std::pow(10.0, draw(-1, 1));
        const auto join = [&](scene::ObjectId a, std::optional<scene::ObjectId> b, const Vector3d& at) {
          fixture.world().add_joint({.kind = is_hinged ? scene::JointKind::kHinge : scene::JointKind::kBall,
                                     .a = a,
                                     .b = b,
                                     .anchor = at,
                                     .axis = Vector3d::UnitY()});
        };
        Vector3d at(4, 11.5, 5);
        std::optional<scene::ObjectId> last;
        std::vector<scene::ObjectSpec> links;
        std::vector<Vector3d> anchors{at};
        for (int i = 1; i <= count; ++i) {
          const double fall = 5 - sag * (1 - std::abs(2.0 * i / count - 1)) - at.z();
          const Vector3d next = at + Vector3d(std::sqrt(length * length - fall * fall), 0, fall);
          auto link = box({0.95 * length, 1.5, 0.2}, 0.5 * (at + next));
          link.mass = 1.0;
          link.orientation = smartsurf::scene::rotation_between(Vector3d::UnitX(), (next - at) / length);
          links.push_back(link);
          anchors.push_back(at = next);
        }
        auto ball = sphere(0.5, {4 + draw(0.2, 0.8) * (at.x() - 4), 11.5, 5.6 + std::pow(10.0, draw(-3, 0))});
        ball.mass = mass;
        std::vector<double> masses;
        std::vector<scene::ObjectId> ids;
        for (const scene::ObjectSpec& link : links) ids.push_back(fixture.add(link)), masses.push_back(1.0);
        for (std::size_t i = 0; i < ids.size(); ++i) {
          join(ids[i], last, anchors[i]);
          last = ids[i];
        }
        join(*last, std::nullopt, anchors.back());
        ids.push_back(fixture.add(ball)), masses.push_back(mass);
        const auto energy = [&] {
          double sum = 0.0;
          for (std::size_t i = 0; i < ids.size(); ++i)
            sum += masses[i] * (0.5 * fixture.velocity(ids[i]).cast<double>().squaredNorm() +
                                kGravity * static_cast<double>(fixture.position(ids[i]).z()));
          return sum;
        };
        const double start = energy(), weight = kGravity * (mass + count);
        double most = start;
        fixture.run(1.5, [&] { most = std::max(most, energy()); });
        EXPECT_LT((most - start) / weight, GetParam().growth)
            << count << " links of " << length << " u, sag " << sag << ", mass " << mass;
      });
}
INSTANTIATE_TEST_SUITE_P(Steps, TautChains, testing::Values(TautBound{60, 0.1}, TautBound{240, 0.02}));
