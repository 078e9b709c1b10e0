defmodule Console.Page do
  @moduledoc """
  Serves a page in the browser that shows a live fleet and commands it, beside the terminal and by the same behaviour,
  `Console.Live`. No robot knows it: whether it falls, or a hundred slow browsers look, changes nothing for them.

      {:ok, _page, url} = Console.Page.start_link(module: Console.Live.Fleet, live: fleet, robots: [:mag1, :mag2])

  Debian's mochiweb serves it. Its tree:

      Console.Page (one_for_one)
      |-- Console.Page.Feed    asks for the scene ten times a second while a browser shows it
      `-- Console.Page.Door    a process for each connection, in which mochiweb runs; ends those that say nothing
          `-- of a WebSocket: Console.Orders carries out what is typed and clicked, Console.Page.Client tells of the robot
              that is looked at, a pusher writes the newest scene, as fast as the browser takes it; all end together, and
              the page connects again

  `Console.Page.Access` decides which requests may look and command. What speaks another language to other programs is served in
  the same way (`Console.Page.Service`).
  """
  use Supervisor
  alias Console.Page
  alias Console.Page.{Door, Feed, Request}

  @typedoc """
  `module` and `live` as in `Console.Live`; `robots` are those of the fleet, or a function without arguments that says
  which these are now; `address` (loopback) and `port` (any that is
  free) to listen on; `token` is demanded where the address is not the loopback's; `origin` is that of a proxy before the page;
  `service` is a `Console.Page.Service` that is served instead of the page.
  """
  @type option ::
          {:module, module()}
          | {:live, term()}
          | {:robots, [atom()] | (... -> [atom()])}
          | {:address, :inet.ip_address()}
          | {:port, :inet.port_number()}
          | {:token, String.t() | nil}
          | {:origin, String.t() | nil}
          | {:service, module() | nil}

  @doc """
  Starts it, and says where it is, such as `http://127.0.0.1:40123/`; the error says in one line why there is no page,
  such as a port that is taken.
  """
  @spec start_link([option()]) :: {:ok, pid(), url :: String.t()} | {:error, line :: String.t()}
  def start_link(options) do
    options =
      Map.new(
        [address: {127, 0, 0, 1}, port: 0, token: nil, origin: nil, service: nil] ++ options
      )

    with :ok <- server(),
         :ok <- guarded(options),
         :ok <- reached(options),
         {:ok, port} <- free(options),
         {:ok, page} <- Supervisor.start_link(__MODULE__, %{options | port: port}) do
      {:ok, page, url(options.service, options.address, port)}
    end
  end

  # A browser on this machine need not know its address.
  defp url(service, {0, 0, 0, 0}, port), do: url(service, {127, 0, 0, 1}, port)

  defp url(service, address, port) do
    scheme = if service, do: service.scheme(), else: "http"
    "#{scheme}://#{:inet.ntoa(address)}:#{port}/"
  end

  defp server do
    case Application.ensure_all_started(:mochiweb) do
      {:ok, _started} -> :ok
      {:error, _reason} -> {:error, "mochiweb is not installed (on Debian: erlang-mochiweb)"}
    end
  end

  defp guarded(%{address: address, token: nil, origin: origin}) do
    cond do
      not Page.Access.loopback?(address) ->
        {:error, "on #{:inet.ntoa(address)} others can reach the page: it needs a token"}

      origin != nil ->
        {:error, "by #{origin} others can reach the page: it needs a token"}

      true ->
        :ok
    end
  end

  defp guarded(_with_a_token), do: :ok

  # A client of a door of its own knows no token.
  defp reached(%{service: service, address: address}) do
    if own_door?(service) and not Page.Access.loopback?(address),
      do:
        {:error,
         "its programs cannot say a token: it is served on this machine alone (ssh -L brings a port of it elsewhere)"},
      else: :ok
  end

  defp own_door?(service),
    do: service != nil and Code.ensure_loaded?(service) and function_exported?(service, :door, 1)

  # Any that is free is chosen once: a door that was restarted must be where the open pages look for it.
  defp free(%{address: address, port: port}) do
    case :gen_tcp.listen(port, ip: address, reuseaddr: true) do
      {:ok, socket} ->
        port = :inet.port(socket)
        :gen_tcp.close(socket)
        port

      {:error, reason} ->
        {:error, "no page on #{:inet.ntoa(address)}:#{port}: #{:inet.format_error(reason)}"}
    end
  end

  @impl Supervisor
  def init(options) do
    robots = options.robots
    robots = if is_list(robots), do: fn -> robots end, else: robots
    session = Base.url_encode64(:crypto.strong_rand_bytes(24), padding: false)

    page =
      options
      |> Map.take([:token, :origin, :port])
      |> Map.merge(%{robots: robots, page: self(), session: session})
      |> Map.put(:answer, options.service || Request)

    at = options |> Map.take([:address, :port]) |> Map.put(:page, page)

    door =
      if own_door?(options.service),
        do: options.service.door(at),
        else: {Door, at}

    source = Map.take(options, [:module, :live])

    feed =
      if options.service,
        do: options.service.feed(Map.put(source, :robots, robots)),
        else: {Feed, source}

    Supervisor.init([feed, door], strategy: :one_for_one)
  end
end
