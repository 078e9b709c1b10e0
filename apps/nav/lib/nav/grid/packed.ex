defmodule Nav.Grid.Packed do
  @moduledoc """
  Packs the walls of a grid into a small term, for messages and recordings: only where walls are. Pure.

  A grid is the same after it was packed and unpacked; its clearances are computed again.
  """
  alias Nav.Grid

  @most 1_000_000

  @typedoc "The size in cells, a cell and the lower left corner in metres, whether it is closed, and the numbers of its walls."
  @type t ::
          {width :: pos_integer(), height :: pos_integer(), cell :: float(), left :: float(),
           low :: float(), closed? :: boolean(), walls :: binary()}

  @doc """
  The walls of a grid; `nil` of none.

      iex> grid = Nav.Grid.new(<<0, 0, 0, 1>>, {2, 2}, 0.1, {1.0, 0.0}, closed?: false)
      iex> packed = Nav.Grid.Packed.pack(grid)
      {2, 2, 0.1, 1.0, 0.0, false, <<3::32>>}
      iex> Nav.Grid.Packed.unpack(packed) == {:ok, grid}
      true
  """
  @spec pack(Grid.t() | nil) :: t() | nil
  def pack(nil), do: nil

  def pack(%Grid{} = grid) do
    walls = for {at, 1} <- :binary.matches(grid.clear, <<0>>), into: <<>>, do: <<at::32>>
    {grid.width, grid.height, grid.cell, grid.left, grid.low, grid.closed?, walls}
  end

  @doc """
  The grid again; `:error` for what is not a packed one.

      iex> Nav.Grid.Packed.unpack({2, 2, 0.1, 1.0, 0.0, false, <<4::32>>})
      :error
  """
  @spec unpack(term()) :: {:ok, Grid.t() | nil} | :error
  def unpack(nil), do: {:ok, nil}

  def unpack({width, height, cell, left, low, closed?, walls})
      when is_integer(width) and is_integer(height) and width > 0 and height > 0 and
             width * height <= @most and is_float(cell) and cell >= 0.01 and cell <= 10.0 and
             is_float(left) and is_float(low) and is_boolean(closed?) and is_binary(walls) and
             rem(byte_size(walls), 4) == 0 do
    with {:ok, cells} <- cells(walls, 0, width * height, []),
         do: {:ok, Grid.new(cells, {width, height}, cell, {left, low}, closed?: closed?)}
  end

  def unpack(_other), do: :error

  # From one wall to the next: their numbers grow.
  defp cells(<<>>, at, size, done),
    do: {:ok, IO.iodata_to_binary(Enum.reverse([free(size - at) | done]))}

  defp cells(<<wall::32, rest::binary>>, at, size, done) when wall >= at and wall < size,
    do: cells(rest, wall + 1, size, [<<free(wall - at)::binary, 1>> | done])

  defp cells(_walls, _at, _size, _done), do: :error

  defp free(count), do: <<0::size(count)-unit(8)>>
end
