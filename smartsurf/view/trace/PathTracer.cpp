#include "smartsurf/view/trace/PathTracer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/threads/ThreadPool.h"
#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/trace/Maths.h"
#include "smartsurf/view/trace/PathSampler.h"
#include "smartsurf/view/trace/Reflection.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaxBounces = 6, kSureBounces = 1;  // later ones end with the probability of what they lose
constexpr int kMaxLayers = 32;                    // translucent surfaces in a row
constexpr float kMaxIndirect = 6.0F;              // radiance that one bounced path adds to a pixel's sample
constexpr float kRefraction = 1.49F;              // of acrylic
constexpr float kAcrylicShade = 0.5F;  // share of the sun that acrylic keeps from what lies behind it
constexpr float kLampShare =
    0.6F;  // of the lamps' brightness; the OpenGL renderer dims them on rough surfaces
constexpr int kTile_px = 16;
constexpr std::uint32_t kSeed = 0x5eed;

// Veach's power heuristic: the weight of a sample that was taken with density a and could have been with b.
float power_weight(float a, float b) {
  return std::isinf(a) ? 1.0F : a <= 0.0F ? 0.0F : a * a / (a * a + b * b);
}

// The light from outside the scene.
class Environment {
 public:
  explicit Environment(const StageLight& light)
      : sun_(vec(light.sun) / static_cast<float>(std::pow(std::sin(kSunRadius), 2))),
        sky_(vec(light.sky)),
        bounce_(vec(light.bounce)),
        lamps_(kLampShare * light.lamps * Vec(1.0F, 0.98F, 0.95F)),
        towards_sun_(towards_sun().cast<float>()),
        least_cosine_(static_cast<float>(std::cos(kSunRadius))) {}

  Vec sky(const Vec& d) const { return bounce_ + (sky_ - bounce_) * smoothstep(-0.06F, 0.06F, d.z()); }
  // A broad lamp above and a strip light at the back, as environment() in ShaderChunks.cpp. Only mirrors show
  // them.
  Vec lamps(const Vec& d) const {
    static const Vec kAbove = Vec(-0.35F, -0.15F, 0.92F).normalized(),
                     kBack = Vec(0.75F, 0.60F, 0.28F).normalized();
    return lamps_ * (smoothstep(0.76F, 0.88F, d.dot(kAbove)) + 0.8F * smoothstep(0.85F, 0.98F, d.dot(kBack)));
  }
  Vec sun(const Vec& d) const { return d.dot(towards_sun_) >= least_cosine_ ? sun_ : Vec::Zero(); }
  bool has_sun() const { return sun_.maxCoeff() > 0.0F; }
  Vec sample_sun(const Eigen::Vector2f& u) const {
    const float z = 1.0F - u.x() * (1.0F - least_cosine_), r = std::sqrt(std::max(1.0F - z * z, 0.0F)),
                angle = 2.0F * kPi * u.y();
    return ShadingFrame(towards_sun_).to_world({r * std::cos(angle), r * std::sin(angle), z}).normalized();
  }
  float sun_density(const Vec& d) const {
    return d.dot(towards_sun_) >= least_cosine_ ? 1.0F / (2.0F * kPi * (1.0F - least_cosine_)) : 0.0F;
  }

 private:
  Vec sun_, sky_, bounce_, lamps_, towards_sun_;
  float least_cosine_;
};

// One path from the eye.
class Path {
 public:
  Path(const TraceScene& scene, const Environment& environment, const std::array<double, 2>& fading,
       PathSampler& sampler)
      : scene_(scene), environment_(environment), fading_(fading), sampler_(sampler) {}

  void follow(const Vec& origin, const Vec& direction);
  const Vec& radiance() const { return radiance_; }
  // 0: the path shows the background.
  float coverage() const { return coverage_; }

 private:
  void add(const Vec& light);
  void add_environment();
  void add_sun(const SurfacePoint& point, const ShadingFrame& frame, const Reflection& reflection,
               float shade);
  void leave(const SurfacePoint& point, const Vec& direction);
  void pass_acrylic(const SurfacePoint& point);
  bool reflect(const SurfacePoint& point);
  bool survives();

  const TraceScene& scene_;
  const Environment& environment_;
  const std::array<double, 2>& fading_;
  PathSampler& sampler_;
  Vec origin_, direction_;
  Vec radiance_ = Vec::Zero();
  float coverage_ = 1.0F;
  // The share of light that the path carries: of all light, and of that which the last surface mirrors.
  Vec carried_ = Vec::Ones(), mirrored_ = Vec::Ones();
  float density_ = std::numeric_limits<float>::infinity();  // of the direction; infinite: there was no choice
  int bounces_ = 0;
};

void Path::add(const Vec& light) {
  const float most = light.maxCoeff();
  radiance_ += bounces_ > 0 && most > kMaxIndirect ? Vec(light * (kMaxIndirect / most)) : light;
}

void Path::add_environment() {
  const float weight = power_weight(density_, environment_.sun_density(direction_));
  add(carried_.cwiseProduct(environment_.sky(direction_) + weight * environment_.sun(direction_)) +
      mirrored_.cwiseProduct(environment_.lamps(direction_)));
}

void Path::leave(const SurfacePoint& point, const Vec& direction) {
  const float side = point.face.dot(direction) > 0.0F ? 1.0F : -1.0F;
  origin_ = point.position + side * scene_.offset() * point.face;
  direction_ = direction;
}

// A smooth surface, and colour that deepens with the way through it.
void Path::pass_acrylic(const SurfacePoint& point) {
  if (point.inside) {
    const Vec tint = point.albedo.cwiseMax(0.02F).array().pow(point.distance / (2.0F * point.size)).matrix();
    carried_ = carried_.cwiseProduct(tint);
    mirrored_ = carried_;
  }
  const float cosine = -point.normal.dot(direction_), ratio = point.inside ? kRefraction : 1.0F / kRefraction,
              passed2 = 1.0F - ratio * ratio * (1.0F - cosine * cosine);
  float reflected = 1.0F;
  if (passed2 > 0.0F) {
    const float passed = std::sqrt(passed2), ways = 1.0F / ratio;
    const float s = (cosine - ways * passed) / (cosine + ways * passed),
                p = (ways * cosine - passed) / (ways * cosine + passed);
    reflected = 0.5F * (s * s + p * p);
  }
  if (sampler_.next().x() < reflected)
    leave(point, (direction_ + 2.0F * cosine * point.normal).normalized());
  else
    leave(point, (ratio * direction_ + (ratio * cosine - std::sqrt(passed2)) * point.normal).normalized());
  // The sun that shines through acrylic onto a surface is a share of the shadow there (add_sun).
  density_ = bounces_ > 0 ? 0.0F : std::numeric_limits<float>::infinity();
}

void Path::add_sun(const SurfacePoint& point, const ShadingFrame& frame, const Reflection& reflection,
                   float shade) {
  const Vec to_sun = environment_.sample_sun(sampler_.next());
  if (to_sun.dot(point.face) <= 0.0F) return;
  const Reflection::Value value = reflection.evaluate(frame.to_local(to_sun));
  if (value.all.maxCoeff() <= 0.0F) return;
  const unsigned sets = shade < kAcrylicShade ? TraceScene::kOpaque | TraceScene::kAcrylic
                                              : static_cast<unsigned>(TraceScene::kOpaque);
  if (scene_.is_hidden(point.position + scene_.offset() * point.face, to_sun, sets)) return;
  const float density = environment_.sun_density(to_sun);
  if (density <= 0.0F) return;
  add(carried_.cwiseProduct(value.all).cwiseProduct(environment_.sun(to_sun)) *
      (power_weight(density, value.density) / density));
}

// Returns false if the path ends here.
bool Path::reflect(const SurfacePoint& point) {
  const ShadingFrame frame(point.normal);
  const Reflection reflection(point.albedo, point.finish, frame.to_local(-direction_));
  const Eigen::Vector2f choices = sampler_.next();
  if (environment_.has_sun()) add_sun(point, frame, reflection, choices.y());
  const Vec in = reflection.sample(sampler_.next(), choices.x());
  const Reflection::Value value = reflection.evaluate(in);
  const Vec direction = frame.to_world(in).normalized();
  if (value.density <= 0.0F || direction.dot(point.face) <= 0.0F) return false;
  mirrored_ = carried_.cwiseProduct(value.mirrored) / value.density;
  carried_ = carried_.cwiseProduct(value.all) / value.density;
  density_ = value.density;
  leave(point, direction);
  return true;
}

bool Path::survives() {
  if (bounces_ <= kSureBounces) return bounces_ < kMaxBounces;
  if (bounces_ >= kMaxBounces) return false;
  const float share = std::min(carried_.maxCoeff(), 1.0F);
  if (sampler_.next().x() >= share) return false;
  carried_ /= share;
  mirrored_ /= share;
  return true;
}

void Path::follow(const Vec& origin, const Vec& direction) {
  origin_ = origin;
  direction_ = direction;
  bool from_eye = true;
  for (int layers = 0; layers < kMaxLayers;) {
    SurfacePoint point;
    if (!scene_.intersect(origin_, direction_,
                          from_eye ? TraceScene::kAll : TraceScene::kAll & ~TraceScene::kLines, point)) {
      if (from_eye)
        coverage_ = 0.0F;
      else
        add_environment();
      return;
    }
    if (point.opacity < 1.0F && sampler_.next().x() >= point.opacity) {
      leave(point, direction_);
      ++layers;
      continue;
    }
    if (point.unlit) return add(carried_.cwiseProduct(point.albedo));
    if (point.ground && from_eye) {
      coverage_ =
          1.0F - smoothstep(static_cast<float>(fading_[0]), static_cast<float>(fading_[1]), point.distance);
      if (coverage_ <= 0.0F) return;
    }
    from_eye = false;
    if (point.finish[3] == kSeeThrough) {
      pass_acrylic(point);
      ++layers;
      continue;
    }
    if (!reflect(point)) return;
    ++bounces_;
    if (!survives()) return;
  }
}

// From pixels to rays, through a lens that is focused on the camera's target.
class Lens {
 public:
  Lens(const Camera& camera, int width, int height, double aperture)
      : rays_(camera.rays(width, height)), focus_(camera.distance()), radius_(aperture / 2.0) {}
  float pixel_slope() const { return static_cast<float>(2.0 * rays_.slope / rays_.height); }
  Ray at(double x, double y, const Eigen::Vector2f& on_lens) const {
    const Ray ray = rays_.at(x, y);
    if (radius_ == 0.0) return ray;
    const Eigen::Vector3d target = ray.origin + ray.direction * (focus_ / ray.direction.dot(rays_.forward));
    const double r = radius_ * std::sqrt(on_lens.x()), angle = 2.0 * kPi * on_lens.y();
    const Eigen::Vector3d origin =
        ray.origin + r * std::cos(angle) * rays_.right + r * std::sin(angle) * rays_.up;
    return {origin, (target - origin).normalized()};
  }

 private:
  Camera::PixelRays rays_;
  double focus_, radius_;
};

}  // namespace

Vec to_screen(const Vec& radiance) {
  constexpr float kStart = 0.76F, kRange = 1.0F - kStart;
  const float peak = radiance.maxCoeff();
  Vec c = radiance.cwiseMax(0.0F);
  if (peak > kStart) {
    const float mapped = 1.0F - kRange * kRange / (peak - kStart + kRange),
                kept = 1.0F / (1.0F + 0.15F * (peak - mapped));
    c = Vec::Constant(mapped * (1.0F - kept)) + c * (mapped / peak * kept);
  }
  return c.array().pow(1.0F / 2.2F).matrix();
}

void PathTracer::require_available() {}

PathTracer::PathTracer(const scene::SceneSpec& spec) : spec_(spec), scene_(spec) {}
PathTracer::~PathTracer() = default;

TracedImage PathTracer::trace(const scene::Snapshot& snapshot,
                              const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                              const DrawOptions& options, const StageLight& light,
                              const TraceSettings& settings, int width, int height) {
  const Lens lens(camera, width, height, settings.aperture);
  scene_.update(snapshot, catalogue, camera, options, light, lens.pixel_slope());
  const Environment environment(light);
  const std::array<double, 2> fading = fading_distances(spec_.surface, camera);
  const auto pixels = width * height;
  TracedImage image{width, height, std::vector<Vec>(pixels, Vec::Zero()), std::vector<float>(pixels)};
  const auto trace_pixel = [&](int x, int y) {
    const std::size_t pixel = y * width + x;
    float coverage = 0.0F;
    Vec sum = Vec::Zero();
    for (int i = 0; i < settings.samples; ++i) {
      PathSampler sampler(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y),
                          static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(settings.samples), kSeed);
      const Eigen::Vector2f in_pixel = sampler.next(), on_lens = sampler.next();
      const Ray ray = lens.at(x + in_pixel.x(), y + in_pixel.y(), on_lens);
      Path path(scene_, environment, fading, sampler);
      path.follow(ray.origin.cast<float>(), ray.direction.cast<float>());
      coverage += path.coverage();
      sum += path.coverage() * path.radiance();
    }
    if (coverage > 0.0F) image.radiance[pixel] = sum / coverage;
    image.coverage[pixel] = coverage / static_cast<float>(settings.samples);
  };
  const int tiles_across = (width + kTile_px - 1) / kTile_px, tiles_down = (height + kTile_px - 1) / kTile_px;
  common::ThreadPool threads(settings.threads, 0.0);
  threads.parallel_for(static_cast<std::uint32_t>(tiles_across * tiles_down),
                       [&](std::uint32_t tile, unsigned) {
                         const int left = static_cast<int>(tile) % tiles_across * kTile_px,
                                   top = static_cast<int>(tile) / tiles_across * kTile_px;
                         for (int y = top; y < std::min(top + kTile_px, height); ++y)
                           for (int x = left; x < std::min(left + kTile_px, width); ++x) trace_pixel(x, y);
                       });
  return image;
}

common::Image PathTracer::render(const scene::Snapshot& snapshot,
                                 const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                                 const DrawOptions& options, const TraceSettings& settings, int width,
                                 int height) {
  const StageLight& light = stage_light(options.stage);
  const TracedImage traced = trace(snapshot, catalogue, camera, options, light, settings, width, height);
  const Vec horizon = vec(light.horizon), zenith = vec(light.zenith);
  common::Image image{width, height, {}};
  image.rgb.reserve(3 * traced.coverage.size());
  for (std::size_t pixel = 0; pixel < traced.coverage.size(); ++pixel) {
    const auto row = static_cast<float>(pixel / width);
    const Vec backdrop = horizon + (zenith - horizon) * (1.0F - (row + 0.5F) / static_cast<float>(height));
    const Vec shown = backdrop + traced.coverage[pixel] * (to_screen(traced.radiance[pixel]) - backdrop);
    for (int c = 0; c < 3; ++c) image.rgb.push_back(to_byte(shown[c]));
  }
  return image;
}

}  // namespace smartsurf::view
