// A cell can do no better than what all of it violates for certain; its centre can do no worse than what is
// violated there. Weights are integers, so both bounds are exact.
#include "center.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "center_cells.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr Index kPlanesACell = 2048;
constexpr std::size_t kShareTaken = 8;   // of the cells that wait, one in so many is taken at once,
constexpr std::size_t kFewestTaken = 8;  // and no fewer than these
constexpr Index kWorkOfThreads = 1 << 18;

// A row of cells that two threads divide, one from either end, so that the cells of each are neighbours.
struct Row {
  std::mutex lock;
  Index front, back;

  // The next one, or -1.
  Index next(bool is_front) {
    const std::lock_guard<std::mutex> guard(lock);
    if (front == back) return -1;
    return is_front ? front++ : --back;
  }
};

// Cells wait with what they violate for certain, and those that violate least are divided next: not one at a time, but
// a share of them in the order of their places, so that the lists of planes of their ancestors are made once for all.
class CenterSearch {
 public:
  CenterSearch(const FramedPlanes& facets, const Border& border, double blur, Index best, const Search& search,
               double* center, double* open_cell, Stop& stop)
      : facets_(facets),
        border_(border),
        blur_(blur),
        search_(search),
        found_{best, best, 0, false},
        least_open_(best),
        center_(center),
        open_cell_(open_cell),
        stop_(stop) {}

  Least run() {
    divide({Waiting(Path{}, 0, 0)}, true);
    while (!waiting_.empty() && !is_over()) divide(take(), false);
    for (const Waiting& cell : waiting_) found_.lower = std::min(found_.lower, cell.sure);
    found_.lower = std::min(found_.lower, found_.best);
    found_.is_over = is_over();
    return found_;
  }

 private:
  Index cells_left() const { return search_.max_cells - found_.n_cells; }
  Index planes_left() const { return (search_.max_cells - n_planes_ / kPlanesACell) * kPlanesACell; }
  bool is_over() const { return cells_left() <= 0 || planes_left() <= 0; }

  // The cells that violate least; `most_taken_` is what the last of them violates.
  WaitingCells take() {
    const Index limit = CellDivider::enough(search_, found_.best);
    const auto closed =
        std::partition(waiting_.begin(), waiting_.end(), [&](const Waiting& c) { return c.sure < limit; });
    for (auto cell = closed; cell != waiting_.end(); ++cell) found_.lower = std::min(found_.lower, cell->sure);
    waiting_.erase(closed, waiting_.end());
    if (waiting_.empty()) return {};
    const std::size_t n = std::min(waiting_.size(), std::max(kFewestTaken, 1 + (waiting_.size() - 1) / kShareTaken));
    const auto last = waiting_.begin() + static_cast<std::ptrdiff_t>(n - 1);
    std::nth_element(waiting_.begin(), last, waiting_.end(),
                     [](const Waiting& a, const Waiting& b) { return a.sure < b.sure; });
    most_taken_ = last->sure;
    const auto rest =
        std::partition(waiting_.begin(), waiting_.end(), [&](const Waiting& c) { return c.sure <= most_taken_; });
    WaitingCells taken(waiting_.begin(), rest);
    waiting_.erase(waiting_.begin(), rest);
    put_back_what_is_too_much(taken);
    std::sort(taken.begin(), taken.end(), [](const Waiting& a, const Waiting& b) { return a.path() < b.path(); });
    return taken;
  }

  // Leaves as many as may still be looked at, those that violate least, at least one.
  void put_back_what_is_too_much(WaitingCells& taken) {
    Index cells = 0, planes = 0;
    const auto is_too_much = [&](const Waiting& cell) {
      cells += 8;
      planes += 9 * static_cast<Index>(cell.n_planes);
      return cells > cells_left() || planes > planes_left();
    };
    if (std::none_of(taken.begin(), taken.end(), is_too_much)) return;
    std::sort(taken.begin(), taken.end(), [](const Waiting& a, const Waiting& b) {
      return std::make_tuple(a.sure, a.path()) < std::make_tuple(b.sure, b.path());
    });
    cells = planes = 0;
    const auto first_over = std::find_if(taken.begin() + 1, taken.end(), is_too_much);
    waiting_.insert(waiting_.end(), first_over, taken.end());
    taken.erase(first_over, taken.end());
  }

  // Divides cells, and what of them violates no more than the last of them.
  void divide(const WaitingCells& taken, bool is_straight) {
    if (taken.empty()) return;
    const auto n = static_cast<Index>(taken.size());
    const Round round{found_.best,
                      least_open_,
                      most_taken_,
                      is_straight,
                      std::max<Index>(1, cells_left() / n),
                      std::max<Index>(1, planes_left() / n)};
    Index work = 0;
    for (const Waiting& cell : taken) work += static_cast<Index>(cell.n_planes);
    const int threads = static_cast<int>(std::min<Index>(work < kWorkOfThreads ? 1 : search_.threads, n));
    while (static_cast<int>(dividers_.size()) < threads)
      dividers_.push_back(std::make_unique<CellDivider>(facets_, border_, blur_, search_));
    const int n_rows = (threads + 1) / 2;
    std::vector<Row> rows(static_cast<std::size_t>(n_rows));
    for (int k = 0; k < n_rows; ++k) {
      rows[static_cast<std::size_t>(k)].front = part_begin(n, n_rows, k);
      rows[static_cast<std::size_t>(k)].back = part_begin(n, n_rows, k + 1);
    }
    run_parts(threads, stop_, [&](int part, Stop& stop) {
      CellDivider& divider = *dividers_[static_cast<std::size_t>(part)];
      Row& row = rows[static_cast<std::size_t>(part / 2)];
      for (Index i; (i = row.next(part % 2 == 0)) >= 0;) {
        const auto at = static_cast<std::size_t>(i);
        divider.divide(taken[at], i, i == 0 ? Path{} : taken[at - 1].path(), round, stop);
      }
    });
    Outcome all = dividers_[0]->take();
    for (int part = 1; part < threads; ++part) all.add(dividers_[static_cast<std::size_t>(part)]->take());
    keep(std::move(all));
  }

  void keep(Outcome&& outcome) {
    if (outcome.best < found_.best) {
      found_.best = outcome.best;
      std::copy_n(outcome.center, 3, center_);
    }
    if (outcome.least_open < least_open_) {
      least_open_ = outcome.least_open;
      std::copy_n(outcome.open_cell, 4, open_cell_);
    }
    found_.lower = std::min(found_.lower, outcome.lower);
    found_.n_cells += outcome.n_cells;
    n_planes_ += outcome.n_planes;
    waiting_.insert(waiting_.end(), outcome.waiting.begin(), outcome.waiting.end());
  }

  FramedPlanes facets_;
  Border border_;
  double blur_;
  Search search_;
  std::vector<std::unique_ptr<CellDivider>> dividers_;
  WaitingCells waiting_;
  Index most_taken_ = -1;
  Index n_planes_ = 0;  // looked at, once for each cell
  Least found_;
  Index least_open_;
  double* center_;
  double* open_cell_;
  Stop& stop_;
};

}  // namespace

// Finds the least violated weight in the unit cube as closely as `search` says.
//
// `best` is a weight known to be reached; when a centre does better, it is written to `center`. `blur` is by how much
// a centre may move later. The cells that violate least for certain are visited first, so that `lower`, which is
// certain, is as high as it can be when `max_cells` have been looked at; it is further below than asked for then, and
// when cells of `max_level` stay open. `open_cell` is then centre and half edge of the least violated cell of
// `max_level`. Nothing depends on the number of threads.
Least least_violated(const FramedPlanes& facets, const Border& border, double blur, Index best, const Search& search,
                     double* center, double* open_cell, Stop& stop) {
  return CenterSearch(facets, border, blur, best, search, center, open_cell, stop).run();
}

}  // namespace voxkernel
