#include "smartsurf/record/Plot.h"

#include <cairo-svg.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "smartsurf/record/CurvePlot.h"
#include "smartsurf/record/PurityPlot.h"
#include "smartsurf/record/TimeSpentPlot.h"
#include "smartsurf/record/TrajectoryPlot.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelsAPoint = 2.0;

// KIND:ARGUMENT:…, in its parts.
std::vector<std::string> parts_of(const std::string& what) {
  std::vector<std::string> parts(1);
  for (const char c : what)
    if (c == ':')
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

std::unique_ptr<Figure> figure_of(const Recording& recording, const std::string& what) {
  std::vector<std::string> arguments = parts_of(what);
  const std::string kind = arguments.front();
  arguments.erase(arguments.begin());
  if (arguments.size() > (kind == "time-spent" ? 1u : 0u) &&
      (kind == "trajectories" || kind == "purity" || kind == "time-spent"))
    throw scene::InputError("--what " + what + ": " + kind + " takes nothing after '" +
                            (kind == "time-spent" ? kind + ":" + arguments[0] : kind) + "'");
  if (kind == "trajectories") return std::make_unique<TrajectoryPlot>(recording);
  if (kind == "purity") return std::make_unique<PurityPlot>(recording);
  if (kind == "time-spent")
    return std::make_unique<TimeSpentPlot>(recording, arguments.empty() ? "" : arguments[0]);
  return std::make_unique<CurvePlot>(recording, scalar(recording, kind, arguments));
}

cairo_status_t append(void* text, const unsigned char* bytes, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), length);
  return CAIRO_STATUS_SUCCESS;
}

void check_drawn(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("drawing failed: ") + cairo_status_to_string(status));
}

struct SurfaceCloser {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceCloser>;

void draw_on(cairo_surface_t* surface, const Figure& figure, double scale) {
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> paper(cairo_create(surface), cairo_destroy);
  cairo_scale(paper.get(), scale, scale);
  use(paper.get(), kWhite);
  cairo_paint(paper.get());
  figure.draw(paper.get());
  check_drawn(cairo_status(paper.get()));
}

std::string as_svg(const Figure& figure) {
  std::string bytes;
  const Surface surface(cairo_svg_surface_create_for_stream(append, &bytes, figure.width(), figure.height()));
  draw_on(surface.get(), figure, 1.0);
  cairo_surface_finish(surface.get());
  check_drawn(cairo_surface_status(surface.get()));
  return bytes;
}

std::string as_png(const Figure& figure) {
  std::string bytes;
  const Surface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(figure.width() * kPixelsAPoint)),
      static_cast<int>(std::ceil(figure.height() * kPixelsAPoint))));
  draw_on(surface.get(), figure, kPixelsAPoint);
  check_drawn(cairo_surface_write_to_png_stream(surface.get(), append, &bytes));
  return bytes;
}

void write_whole(const fs::path& path, const std::string& bytes) {
  const fs::path part = path.string() + ".part" + std::to_string(::getpid());
  std::error_code error;
  errno = 0;
  bool good = !fs::is_directory(path, error);
  if (!good) errno = EISDIR;
  if (good) {
    std::ofstream file(part, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    good = file.good();
  }
  const int reason = errno;
  if (good) fs::rename(part, path, error);
  if (good && !error) return;
  std::string why = !good ? std::strerror(reason) : error.message();
  fs::remove(part, error);
  throw scene::InputError(path.string() + ": cannot be written: " + why);
}

}  // namespace

std::vector<std::string> plot_kinds() {
  std::vector<std::string> kinds = {"trajectories", "purity", "time-spent[:LABEL]"};
  for (std::string& form : scalar_kinds()) kinds.push_back(std::move(form));
  return kinds;
}

void plot(const Recording& recording, const std::string& what, const fs::path& path) {
  const std::string ending = path.extension().string();
  if (ending != ".svg" && ending != ".png")
    throw scene::InputError(path.string() + ": unknown kind of picture '" + ending +
                            "': the name must end in .svg or .png");
  if (!recording.has_objects())
    throw scene::InputError(recording.path().string() +
                            ": has no object poses: the run recorded no frame, or its "
                            "experiment says record { objects = false }");
  const std::unique_ptr<Figure> figure = figure_of(recording, what);
  write_whole(path, ending == ".svg" ? as_svg(*figure) : as_png(*figure));
}

}  // namespace smartsurf::record
