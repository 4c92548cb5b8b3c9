// Times the feature edges of CGAL's Voronoi covariance measure (Q. Mérigot, M. Ovsjanikov, L. Guibas, IEEE TVCG 2011).
//
// build: g++ -O3 -march=native -DNDEBUG -DCGAL_EIGEN3_ENABLED -I/usr/include/eigen3 vcm_edges.cpp -o vcm_edges -lgmp -lmpfr
// run:   vcm_edges points.f64 OFFSET CONVOLUTION THRESHOLD     (rows of x, y, z; radii in the unit of the points)
//
// Prints the number of points, how many lie on an edge, and processor seconds of `compute_vcm` and of the decisions.

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/vcm_estimate_edges.h>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

typedef CGAL::Exact_predicates_inexact_constructions_kernel Kernel;

static double seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

int main(int count, char** words)
{
    if (count != 5) {
        std::fprintf(stderr, "vcm_edges points.f64 OFFSET CONVOLUTION THRESHOLD\n");
        return 2;
    }
    std::vector<Kernel::Point_3> points;
    std::FILE* file = std::fopen(words[1], "rb");
    if (!file)
        return 1;
    for (double row[3]; std::fread(row, sizeof row, 1, file) == 1;)
        points.emplace_back(row[0], row[1], row[2]);
    std::fclose(file);
    std::vector<std::array<double, 6>> measures;
    const double start = seconds();
    CGAL::compute_vcm(points, measures, std::atof(words[2]), std::atof(words[3]));
    const double measured = seconds();
    std::size_t edges = 0;
    for (auto& measure : measures)
        edges += CGAL::vcm_is_on_feature_edge(measure, std::atof(words[4]));
    std::printf("%zu points, %zu on edges, %.2f s and %.2f s\n", points.size(), edges, measured - start, seconds() - measured);
}
