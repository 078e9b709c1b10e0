/* Joins the pieces of a picture to regions, as Sim.Compute.Regions does; see there for the rules and the order. */
#include <string.h>

#include "kernel.h"

enum { NONE = -1 };

/* Regions by their numbers, in the order of the reference's lists. */
typedef struct {
    int32_t *at;
    size_t count;
} list;

static void append(list *to, const list *more)
{
    memcpy(to->at + to->count, more->at, more->count * sizeof *more->at);
    to->count += more->count;
}

static void prepend(list *to, const list *more)
{
    memmove(to->at + more->count, to->at, to->count * sizeof *to->at);
    memcpy(to->at, more->at, more->count * sizeof *more->at);
    to->count += more->count;
}

static int meets(const sim_region *region, const sim_row *rows, int32_t top, int32_t bottom)
{
    for (int32_t row = region->rows; row != NONE; row = rows[row].next)
        if (rows[row].top <= bottom && rows[row].bottom >= top)
            return 1;
    return 0;
}

static void add(sim_region *to, const sim_region *more)
{
    to->area += more->area;
    to->columns += more->columns;
    to->height += more->height;
    to->left = more->left < to->left ? more->left : to->left;
    to->right = more->right > to->right ? more->right : to->right;
    to->top = more->top < to->top ? more->top : to->top;
    to->bottom = more->bottom > to->bottom ? more->bottom : to->bottom;
}

/* Takes out of the list the regions of this kind that have one of these rows, and adds them to another one; and their
 * rows, if they are of the newest column. */
static void take(list *from, sim_region *to, const sim_regions *all, int32_t top, int32_t bottom,
                 int newest)
{
    size_t kept = 0;

    for (size_t k = 0; k < from->count; k++) {
        sim_region *region = all->regions + from->at[k];
        if (region->kind != to->kind || !meets(region, all->rows, top, bottom)) {
            from->at[kept++] = from->at[k];
            continue;
        }
        add(to, region);
        for (int32_t row = region->rows, next; newest && row != NONE; row = next) {
            next = all->rows[row].next;
            all->rows[row].next = to->rows;
            to->rows = row;
        }
    }
    from->count = kept;
}

size_t sim_join(const sim_piece *pieces, size_t count, const uint8_t *least, const sim_regions *all,
                int32_t *order)
{
    list next = {all->next, 0}, open = {all->open, 0}, closed = {order, 0};
    int32_t last = NONE - 1;

    for (size_t k = 0; k < count; k++) {
        const sim_piece *piece = pieces + k;
        const int64_t area = piece->bottom - piece->top + 1;
        sim_region *region = all->regions + k;

        if (piece->luma < least[piece->kind])
            continue;
        if (piece->column != last) {
            append(&closed, &open);
            open.count = 0;
            if (last == piece->column - 1)
                append(&open, &next);
            else
                prepend(&closed, &next);
            next.count = 0;
            last = piece->column;
        }
        all->rows[k] = (sim_row){piece->top, piece->bottom, NONE};
        *region = (sim_region){piece->kind,   (int32_t)k,    piece->column,
                               piece->column, piece->top,    piece->bottom,
                               area,          area * piece->column,
                               area * (piece->top + piece->bottom)};
        take(&open, region, all, piece->top, piece->bottom, 0);
        take(&next, region, all, piece->top - 1, piece->bottom + 1, 1);
        const int32_t made = (int32_t)k;
        prepend(&next, &(list){(int32_t *)&made, 1});
    }
    prepend(&closed, &next);
    append(&closed, &open);
    return closed.count;
}
