defmodule Nav.MapFile.Png do
  @moduledoc false
  # Reads PNG pictures: grey of 1, 2, 4, 8 or 16 bits, grey with alpha, RGB, RGBA of 8 or 16 bits a channel, and palettes;
  # also interlaced ones (`Nav.MapFile.Adam7`). Colours become greys, what is transparent white, or of another
  # shade if it means something else: then what is less than half opaque has that, and the rest its own. Pure.
  alias Nav.MapFile.{Adam7, Picture}

  @damaged {:error, "the picture is damaged"}

  @doc """
  Reads the picture in the chunks after the signature; it may have at most `most` pixels, `transparent` is the shade of what
  is transparent. Beside the answer it holds no more than a few rows at a time.
  """
  @spec decode(binary(), pos_integer(), transparent :: byte()) ::
          {:ok, Picture.t()} | {:error, String.t()}
  def decode(chunks, most, transparent) do
    with {:ok, [{"IHDR", header} | chunks]} <- chunks(chunks, []),
         {:ok, %{width: width, height: height} = header} <- header(header, most),
         {:ok, clear} <- clear(header, chunks),
         header = Map.merge(header, %{transparent: transparent, clear: clear}),
         {:ok, palette} <- palette(header, chunks),
         {:ok, rows} <- inflate(for({"IDAT", data} <- chunks, do: data), header, palette) do
      if Enum.all?(rows, &(byte_size(&1) == width)),
        do: {:ok, {width, height, rows}},
        else: @damaged
    else
      {:ok, _no_header} -> @damaged
      {:error, reason} -> {:error, reason}
    end
  end

  defp chunks(
         <<length::32, type::binary-size(4), data::binary-size(length), crc::32, rest::binary>>,
         seen
       ) do
    cond do
      :erlang.crc32([type, data]) != crc -> @damaged
      type == "IEND" -> {:ok, Enum.reverse(seen)}
      true -> chunks(rest, [{type, data} | seen])
    end
  end

  defp chunks(_cut_short, _seen), do: @damaged

  # The number of channels of each colour type.
  @channels %{0 => 1, 2 => 3, 3 => 1, 4 => 2, 6 => 4}

  defp header(<<width::32, height::32, depth, type, 0, 0, interlace>>, most)
       when is_map_key(@channels, type) and width > 0 and height > 0 and interlace in 0..1 do
    with false <- depth not in [1, 2, 4, 8, 16] or (depth < 8 and type not in [0, 3]),
         false <- depth == 16 and type == 3,
         :ok <- Picture.size(width, height, most) do
      {:ok, %{width: width, height: height, depth: depth, type: type, interlace: interlace}}
    else
      true -> @damaged
      {:error, line} -> {:error, line}
    end
  end

  defp header(_other, _most), do: @damaged

  # An interlaced picture consists of smaller ones, each filtered on its own.
  defp passes(%{interlace: 0, width: width, height: height}), do: [{width, height}]
  defp passes(%{width: width, height: height}), do: Adam7.sizes(width, height)

  defp stride(width, %{depth: depth, type: type}), do: div(width * depth * @channels[type] + 7, 8)

  # Row by row as they come out, and never more than the header says, however much the data would
  # unpack to.
  defp inflate(data, %{depth: depth, type: type} = header, palette) do
    z = :zlib.open()
    :ok = :zlib.inflateInit(z)

    scan =
      pass(%{
        pixel: max(div(depth * @channels[type], 8), 1),
        header: header,
        palette: palette,
        passes: passes(header),
        left: 0,
        rows: [],
        done: []
      })

    try do
      inflate(z, :zlib.safeInflate(z, data), <<>>, scan)
    rescue
      _damaged in [ErlangError, ArgumentError] -> @damaged
    after
      :zlib.close(z)
    end
  end

  # Begins the next of the pictures, if the last one is complete; empty ones have no rows.
  defp pass(%{left: 0, passes: [{width, height} | passes]} = scan) do
    stride = stride(width, scan.header)
    done = if scan[:width], do: [Enum.reverse(scan.rows) | scan.done], else: scan.done

    pass(
      Map.merge(scan, %{
        passes: passes,
        width: width,
        stride: stride,
        above: List.duplicate(0, stride),
        left: if(width == 0, do: 0, else: height),
        rows: [],
        done: done
      })
    )
  end

  defp pass(scan), do: scan

  defp whole(%{header: %{interlace: 0}, rows: rows}), do: Enum.reverse(rows)

  defp whole(%{header: header, rows: rows, done: done}) do
    [Enum.reverse(rows) | done] |> Enum.reverse() |> Adam7.weave(header.height)
  end

  defp inflate(z, {state, output}, rest, scan) do
    {rest, scan} = rows(IO.iodata_to_binary([rest | output]), scan)

    cond do
      scan.left == 0 -> {:ok, whole(scan)}
      state == :finished -> @damaged
      # Data that ends too early would return nothing for ever.
      output == [] -> @damaged
      true -> inflate(z, :zlib.safeInflate(z, []), rest, scan)
    end
  end

  # Of grey and of RGB one colour may be transparent, given in two bytes a channel.
  defp clear(%{type: type, depth: depth}, chunks) when type in [0, 2] do
    width = if type == 0, do: 2, else: 6

    case List.keyfind(chunks, "tRNS", 0) do
      nil -> {:ok, nil}
      {_, colour} when byte_size(colour) != width -> @damaged
      {_, colour} when depth == 16 -> {:ok, colour}
      {_, colour} -> {:ok, for(<<sample::16 <- colour>>, into: <<>>, do: <<sample>>)}
    end
  end

  defp clear(_header, _chunks), do: {:ok, nil}

  defp palette(%{type: 3} = header, chunks) do
    {_, colours} = List.keyfind(chunks, "PLTE", 0, {"PLTE", <<>>})
    {_, alphas} = List.keyfind(chunks, "tRNS", 0, {"tRNS", <<>>})

    if byte_size(colours) <= 768 and byte_size(alphas) <= 256 do
      alphas = :binary.bin_to_list(alphas)
      colours = Enum.with_index(for <<c::binary-size(3) <- colours>>, do: c)

      {:ok,
       for({rgb, k} <- colours, into: %{}, do: {k, grey(rgb, Enum.at(alphas, k, 255), header)})}
    else
      @damaged
    end
  end

  defp palette(_header, _chunks), do: {:ok, nil}

  # Takes the whole rows; returns the bytes of the one that has only begun.
  defp rows(bytes, %{stride: stride, left: left} = scan)
       when left > 0 and byte_size(bytes) > stride do
    <<filter, row::binary-size(stride), rest::binary>> = bytes
    row = unfilter(filter, :binary.bin_to_list(row), scan.above, scan.pixel)
    greys = greys(row, scan.width, scan.header, scan.palette)
    rows(rest, pass(%{scan | above: row, left: left - 1, rows: [greys | scan.rows]}))
  end

  defp rows(bytes, scan), do: {bytes, scan}

  defp unfilter(0, row, _above, _pixel), do: row

  defp unfilter(2, row, above, _pixel),
    do: Enum.zip_with(row, above, fn x, b -> rem(x + b, 256) end)

  # The byte to the left is the one decoded `pixel` bytes before; before the row there is 0.
  defp unfilter(filter, row, above, pixel) do
    before = List.duplicate(0, pixel)
    done = filter(filter, row, above, before ++ above, before, pixel)
    done |> Enum.reverse() |> Enum.drop(pixel)
  end

  defp filter(_filter, [], _above, _corner, done, _pixel), do: done

  defp filter(filter, [x | row], [b | above], [c | corner], done, pixel) do
    a = left(done, pixel)
    value = rem(x + guess(filter, a, b, c), 256)
    filter(filter, row, above, corner, [value | done], pixel)
  end

  defp left([a | _], 1), do: a
  defp left([_, a | _], 2), do: a
  defp left([_, _, a | _], 3), do: a
  defp left([_, _, _, a | _], 4), do: a
  defp left([_, _, _, _, _, a | _], 6), do: a
  defp left([_, _, _, _, _, _, _, a | _], 8), do: a

  defp guess(1, a, _b, _c), do: a
  defp guess(3, a, b, _c), do: div(a + b, 2)

  defp guess(4, a, b, c) do
    {pa, pb, pc} = {abs(b - c), abs(a - c), abs(a + b - 2 * c)}

    cond do
      pa <= pb and pa <= pc -> a
      pb <= pc -> b
      true -> c
    end
  end

  # An unknown filter is ignored: the picture will look wrong, but nothing crashes.
  defp guess(_unknown, _a, _b, _c), do: 0

  for depth <- [1, 2, 4, 8] do
    defp samples(bytes, unquote(depth)), do: for(<<s::size(unquote(depth)) <- bytes>>, do: s)
  end

  defp greys(row, width, %{depth: depth, type: type, clear: clear} = header, palette) do
    raw = :binary.list_to_bin(row)
    bytes = if clear, do: raw, else: upper(raw, depth)

    case type do
      _ when clear != nil ->
        cleared(bytes, clear, header)

      0 when depth >= 8 ->
        bytes

      0 ->
        for s <- samples(bytes, depth), into: <<>>, do: <<div(255 * s, white(depth))>>

      2 ->
        for <<rgb::binary-size(3) <- bytes>>, into: <<>>, do: <<grey(rgb, 255, header)>>

      # A colour that the palette does not have is black.
      3 ->
        for k <- samples(bytes, depth), into: <<>>, do: <<Map.get(palette, k, 0)>>

      4 ->
        for <<g, alpha <- bytes>>, into: <<>>, do: <<grey(<<g, g, g>>, alpha, header)>>

      6 ->
        for <<rgb::binary-size(3), alpha <- bytes>>, into: <<>>, do: <<grey(rgb, alpha, header)>>
    end
    # The last byte of a row may hold more pixels than the row has.
    |> binary_part(0, width)
  end

  # All bytes of a pixel are compared, also those of its lower eight bits.
  defp cleared(bytes, <<clear>>, %{type: 0, depth: depth} = header) when depth < 8 do
    for s <- samples(bytes, depth),
        into: <<>>,
        do: <<if(s == clear, do: header.transparent, else: div(255 * s, white(depth)))>>
  end

  defp cleared(bytes, clear, %{depth: depth} = header) do
    size = byte_size(clear)

    for <<pixel::binary-size(size) <- bytes>>, into: <<>> do
      case upper(pixel, depth) do
        _colour when pixel == clear -> <<header.transparent>>
        <<_grey>> = grey -> grey
        rgb -> <<grey(rgb, 255, header)>>
      end
    end
  end

  # Of 16 bits the upper eight.
  defp upper(bytes, 16), do: for(<<high, _low <- bytes>>, into: <<>>, do: <<high>>)
  defp upper(bytes, _depth), do: bytes

  defp white(depth), do: Bitwise.bsl(1, depth) - 1

  defp grey(_rgb, alpha, %{transparent: shade}) when alpha < 128 and shade != 255, do: shade
  defp grey(rgb, _alpha, %{transparent: shade}) when shade != 255, do: grey(rgb, 255)
  defp grey(rgb, alpha, _on_white), do: grey(rgb, alpha)

  # On a white background.
  defp grey(<<r, g, b>>, alpha),
    do: div(255 * 255_000 - alpha * (255_000 - (299 * r + 587 * g + 114 * b)), 255_000)
end
