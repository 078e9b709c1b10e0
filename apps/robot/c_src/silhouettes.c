#include "silhouettes.h"

#include <math.h>

/* The same as in Robot.Localiser.Silhouettes.Reference and Robot.Localiser.Columns, in the same order: the results are equal to
   the bit, because Erlang's :math calls the same functions. */
#define ASIDE 1.3
#define STRANGE 0.5
#define WIDE 2.0
#define NEAR 0.1

/* By pointers: a compiler may put sine and cosine of one angle together, into a function that rounds in its own way. */
static double (*volatile cosine)(double) = cos;
static double (*volatile sine)(double) = sin;

static double wrap(double angle)
{
    if (angle > -M_PI && angle <= M_PI)
        return angle;
    double rest = fmod(angle, 2 * M_PI);
    return rest > M_PI ? rest - 2 * M_PI : rest <= -M_PI ? rest + 2 * M_PI : rest;
}

static uint64_t between(double left, double right)
{
    int from = left < 0.0 ? 0 : left > SILHOUETTES_COLUMNS ? SILHOUETTES_COLUMNS : (int)left;
    int to = right > SILHOUETTES_COLUMNS - 1 ? SILHOUETTES_COLUMNS - 1 : right < -1.0 ? -1 : (int)right;
    return to < from ? 0 : (UINT64_C(1) << (to + 1)) - (UINT64_C(1) << from);
}

static uint64_t span(double bearing, double half, double pan, double focal)
{
    bearing = wrap(bearing - pan);
    if (fabs(bearing) - half > ASIDE)
        return 0;
    double left = bearing + half < ASIDE ? bearing + half : ASIDE;
    double right = bearing - half > -ASIDE ? bearing - half : -ASIDE;
    double middle = SILHOUETTES_COLUMNS / 2.0;
    return between(round(middle - focal * tan(left)), round(middle - focal * tan(right)) - 1);
}

/* The pose at exposure of a robot that stands so far along the line. */
static silhouettes_pose exposed(const silhouettes_search *search, double way)
{
    const silhouettes_pose *believed = &search->believed, *back = &search->back;
    double x = believed->x + way * search->axis_x, y = believed->y + way * search->axis_y;
    double heading = wrap(believed->heading + way * search->turn);
    double c = cosine(heading), s = sine(heading);
    silhouettes_pose at = {x + c * back->x - s * back->y, y + s * back->x + c * back->y, wrap(heading + back->heading)};
    return at;
}

void silhouettes_try(const silhouettes_search *search, uint64_t seen, const silhouettes_body *bodies, size_t count, double way,
                     int *wrong, int *clear)
{
    silhouettes_pose at = exposed(search, way);
    double ax = cosine(at.heading + search->pan), ay = sine(at.heading + search->pan);
    uint64_t known = 0, unknown = 0;

    for (size_t k = 0; k < count; k++) {
        const silhouettes_body *body = &bodies[k];
        double dx = body->x - at.x, dy = body->y - at.y;
        double square = dx * dx + dy * dy;
        if (body->sd <= STRANGE && dx * ax + dy * ay < 0.0 && square > 16 * body->radius * body->radius)
            continue;
        double distance = sqrt(square);
        double half = distance > body->radius ? asin(body->radius / distance) : asin(1.0);
        double bearing = wrap(atan2(dy, dx) - at.heading);
        if (body->sd > STRANGE) {
            double wide = half + WIDE * body->sd / (distance > NEAR ? distance : NEAR);
            unknown |= span(bearing, wide, search->pan, search->focal);
        } else {
            known |= span(bearing, half, search->pan, search->focal);
        }
    }
    *wrong = __builtin_popcountll((known ^ seen) & ~unknown);
    *clear = __builtin_popcountll(seen & ~unknown);
}
