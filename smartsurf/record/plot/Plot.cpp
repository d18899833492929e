#include "smartsurf/record/plot/Plot.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <fontconfig/fontconfig.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <new>
#include <stdexcept>
#include <utility>

#include "common/files/AtomicFile.h"
#include "common/files/Installation.h"
#include "smartsurf/record/plot/ChartFile.h"
#include "smartsurf/record/plot/CurveChart.h"
#include "smartsurf/record/plot/TimeSpentPlot.h"
#include "smartsurf/record/plot/TrajectoryPlot.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelsPerPoint = 2.0;
constexpr double kMaxSide = 14400.0;  // points: the largest page of PDF; as pixels, Cairo's largest is 32767
constexpr double kMaxArea = 5e7;      // 800 MB of pixels

// Splits KIND:ARGUMENT:….
std::vector<std::string> split_at_colons(const std::string& what) {
  std::vector<std::string> parts(1);
  for (const char c : what)
    if (c == ':')
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

std::unique_ptr<Figure> make_figure(const Recording& recording, const std::string& what) {
  std::vector<std::string> arguments = split_at_colons(what);
  const std::string kind = arguments.front();
  arguments.erase(arguments.begin());
  if (kind == "trajectories" && !arguments.empty())
    throw scene::InputError("--what " + what + ": trajectories takes nothing after 'trajectories'");
  if (kind == "trajectories") return std::make_unique<TrajectoryPlot>(recording);
  if (kind == "time-spent")
    return std::make_unique<TimeSpentPlot>(recording, arguments.empty() ? "" : what.substr(kind.size() + 1));
  return std::make_unique<ChartFigure>(make_curve_chart(recording, time_series(recording, kind, arguments)));
}

cairo_status_t append_bytes(void* text, const unsigned char* bytes, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), length);
  return CAIRO_STATUS_SUCCESS;
}

void check_cairo(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("drawing failed: ") + cairo_status_to_string(status));
}

struct CairoSurfaceDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, CairoSurfaceDeleter>;

void draw_figure(cairo_surface_t* surface, const Figure& figure, double scale) {
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> cr(cairo_create(surface), cairo_destroy);
  cairo_scale(cr.get(), scale, scale);
  set_pen(cr.get(), kWhite);
  cairo_paint(cr.get());
  figure.draw(cr.get());
  check_cairo(cairo_status(cr.get()));
}

std::string render_svg(const Figure& figure) {
  std::string bytes;
  const CairoSurface surface(
      cairo_svg_surface_create_for_stream(append_bytes, &bytes, figure.width(), figure.height()));
  draw_figure(surface.get(), figure, 1.0);
  cairo_surface_finish(surface.get());
  check_cairo(cairo_surface_status(surface.get()));
  return bytes;
}

// Equal figures give equal bytes: the date of creation, otherwise now, is a fixed one.
std::string render_pdf(const Figure& figure) {
  std::string bytes;
  const CairoSurface surface(
      cairo_pdf_surface_create_for_stream(append_bytes, &bytes, figure.width(), figure.height()));
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  draw_figure(surface.get(), figure, 1.0);
  cairo_surface_finish(surface.get());
  check_cairo(cairo_surface_status(surface.get()));
  return bytes;
}

std::string render_png(const Figure& figure) {
  std::string bytes;
  const CairoSurface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(figure.width() * kPixelsPerPoint)),
      static_cast<int>(std::ceil(figure.height() * kPixelsPerPoint))));
  draw_figure(surface.get(), figure, kPixelsPerPoint);
  check_cairo(cairo_surface_write_to_png_stream(surface.get(), append_bytes, &bytes));
  return bytes;
}

void require_picture_name(const fs::path& path) {
  const std::string extension = path.extension().string();
  if (extension != ".svg" && extension != ".pdf" && extension != ".png")
    throw scene::InputError(path.string() + ": unknown kind of picture '" + extension +
                            "': the name must end in .svg, .pdf or .png");
}

void add_installed_fonts(FcConfig* configuration) {
  for (const char* const name : {"DejaVuSans.ttf", "DejaVuSans-Bold.ttf"})
    if (const std::string file = common::font_file(name).string(); !file.empty())
      FcConfigAppFontAddFile(configuration, reinterpret_cast<const FcChar8*>(file.c_str()));
}

// Leads standard error to nowhere while it lives: fontconfig prints that it can keep no cache of fonts, which
// it does without.
class StandardErrorSilenced {
 public:
  StandardErrorSilenced() : kept_(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0)) {
    const int nowhere = kept_ < 0 ? -1 : ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere < 0) return;
    ::dup2(nowhere, STDERR_FILENO);
    ::close(nowhere);
  }
  ~StandardErrorSilenced() {
    if (kept_ < 0) return;
    ::dup2(kept_, STDERR_FILENO);
    ::close(kept_);
  }
  StandardErrorSilenced(const StandardErrorSilenced&) = delete;
  StandardErrorSilenced& operator=(const StandardErrorSilenced&) = delete;

 private:
  int kept_;
};

// Cairo and FcInit() have fontconfig try for ever to load its configuration where there is no memory.
void load_fonts() {
  static const bool once = [] {
    const StandardErrorSilenced silenced;
    // Without a configuration it would print an error and find no font.
    FcConfig* configuration = FcConfigCreate();  // without one, the question below loads what it asks for
    if (configuration == nullptr) throw std::bad_alloc();
    if (FcChar8* const file = FcConfigGetFilename(configuration, nullptr); file != nullptr) {
      FcStrFree(file);
      FcConfigDestroy(configuration);
      configuration = FcInitLoadConfigAndFonts();
    }
    if (configuration == nullptr) throw std::bad_alloc();
    const FcFontSet* const fonts = FcConfigGetFonts(configuration, FcSetSystem);
    if (fonts == nullptr || fonts->nfont == 0) add_installed_fonts(configuration);
    if (!FcConfigSetCurrent(configuration)) throw std::bad_alloc();
    FcConfigDestroy(configuration);  // the current one holds a reference of its own
    return true;
  }();
  (void)once;
}

// `source` is where the figure's contents come from.
void write_figure(const Figure& figure, const fs::path& source, const fs::path& path) {
  const double width = figure.width(), height = figure.height();
  if (width > kMaxSide || height > kMaxSide || width * height > kMaxArea)
    throw scene::InputError(
        fmt::format("{}: a figure of {:.0f} x {:.0f} points: must be at most {:.0f} wide and high, and have "
                    "an area of at "
                    "most {:.0f} million square points",
                    source.string(), width, height, kMaxSide, 1e-6 * kMaxArea));
  load_fonts();
  const std::string extension = path.extension().string();
  if (const std::error_code error = common::replace_file(path, extension == ".svg"   ? render_svg(figure)
                                                               : extension == ".pdf" ? render_pdf(figure)
                                                                                     : render_png(figure)))
    throw scene::InputError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace

std::vector<std::string> plot_kinds() {
  std::vector<std::string> kinds = {"trajectories", "time-spent[:LABEL]"};
  for (std::string& form : time_series_kinds()) kinds.push_back(std::move(form));
  return kinds;
}

void write_plot(const Recording& recording, const std::string& what, const fs::path& path) {
  require_picture_name(path);
  // The others read poses only if they show objects.
  const std::string kind = split_at_colons(what).front();
  const bool shows_objects = kind == "trajectories" || kind == "time-spent";
  if (recording.frames() == 0)
    throw scene::InputError(recording.path().string() + ": has no frames: the run recorded none");
  if (shows_objects && !recording.has_objects())
    throw scene::InputError(
        recording.path().string() + ": " + why_no_objects(recording.meta()) +
        (recording.meta().is_simulated ? "" : "; --what names what to plot instead, such as height:0,0"));
  write_figure(*make_figure(recording, what), recording.path(), path);
}

void write_chart(const fs::path& description, const fs::path& path) {
  require_picture_name(path);
  write_figure(read_chart_file(description), description, path);
}

void write_curves(const std::vector<double>& time, TimeSeries series, const std::string& subtitle,
                  const fs::path& path) {
  require_picture_name(path);
  write_figure(ChartFigure(make_curve_chart(time, std::move(series), subtitle)), path, path);
}

}  // namespace smartsurf::record
